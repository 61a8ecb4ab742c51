#include "core/structure/scored_matches.h"

#include <algorithm>
#include <limits>
#include <queue>
#include <utility>

namespace cairn {
namespace {

constexpr size_t kNumReadAtOnce = 1 << 16;  // of a run

}  // namespace

// The next match of a run of the file.
class ScoredMatches::RunReader {
 public:
  RunReader(const ScratchFile& file, size_t begin, size_t size)
      : file_(file), next_(begin), end_(begin + size) {}

  // False at the end.
  Result<bool> Advance() {
    if (++place_ < buffer_.size()) return true;
    buffer_.resize(std::min(kNumReadAtOnce, end_ - next_));
    place_ = 0;
    if (buffer_.empty()) return false;
    CAIRN_RETURN_IF_ERROR(file_.Read(next_ * sizeof(Match), buffer_.data(), buffer_.size() * sizeof(Match)));
    next_ += buffer_.size();
    return true;
  }
  const Match& match() const { return buffer_[place_]; }

 private:
  const ScratchFile& file_;
  size_t next_, end_;  // matches of the file
  std::vector<Match> buffer_;
  size_t place_ = 0;
};

ScoredMatches::ScoredMatches(const std::vector<int>& num_keypoints)
    : ScoredMatches(num_keypoints, "", std::numeric_limits<size_t>::max()) {}

ScoredMatches::ScoredMatches(const std::vector<int>& num_keypoints, std::string beside,
                             size_t max_num_in_memory)
    : first_keypoint_{0}, max_num_in_memory_(max_num_in_memory), file_(std::move(beside)) {
  for (const int num : num_keypoints) first_keypoint_.push_back(first_keypoint_.back() + num);
}

void ScoredMatches::Add(const TrackElement& element1, const TrackElement& element2, int32_t dot_product) {
  if (matches_.size() >= max_num_in_memory_) WriteRun();
  const auto keypoint = [&](const TrackElement& element) {
    return first_keypoint_[element.image_idx] + static_cast<int32_t>(element.keypoint_idx);
  };
  matches_.push_back({keypoint(element1), keypoint(element2), dot_product});
}

void ScoredMatches::WriteRun() {
  if (status_.ok()) {
    std::sort(matches_.begin(), matches_.end());
    status_ = file_.Append(matches_.data(), matches_.size() * sizeof(Match));
  }
  if (status_.ok()) run_sizes_.push_back(matches_.size());
  matches_.clear();
}

Status ScoredMatches::Visit(const std::function<void(const Match&)>& visit) && {
  if (run_sizes_.empty() && status_.ok()) {
    std::sort(matches_.begin(), matches_.end());
    for (const Match& match : matches_) visit(match);
    std::vector<Match>().swap(matches_);
    return Ok();
  }
  if (!matches_.empty()) WriteRun();
  std::vector<Match>().swap(matches_);
  CAIRN_RETURN_IF_ERROR(status_);
  std::vector<RunReader> runs;
  size_t begin = 0;
  for (const size_t size : run_sizes_) runs.emplace_back(file_, std::exchange(begin, begin + size), size);
  const auto is_later = [&](size_t a, size_t b) { return runs[b].match() < runs[a].match(); };
  std::priority_queue<size_t, std::vector<size_t>, decltype(is_later)> queue(is_later);
  const auto advance = [&](size_t run) -> Status {
    CAIRN_ASSIGN_OR_RETURN(const bool has_next, runs[run].Advance());
    if (has_next) queue.push(run);
    return Ok();
  };
  for (size_t run = 0; run < runs.size(); ++run) CAIRN_RETURN_IF_ERROR(advance(run));
  while (!queue.empty()) {
    const size_t run = queue.top();
    queue.pop();
    visit(runs[run].match());
    CAIRN_RETURN_IF_ERROR(advance(run));
  }
  return Ok();
}

}  // namespace cairn
