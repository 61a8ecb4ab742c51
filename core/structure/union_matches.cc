#include "core/structure/union_matches.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "core/structure/disjoint_sets.h"

namespace cairn {
namespace {

// Disjoint sets of keypoints, of each image one at most.  Sixteen bytes a keypoint.
class TrackSets {
 public:
  // first_keypoint: per image, counted over all; then the number of all.
  explicit TrackSets(const std::vector<int32_t>& first_keypoint)
      : first_keypoint_(first_keypoint),
        sets_(first_keypoint.back()),
        next_(first_keypoint.back()),
        seen_(first_keypoint.size() - 1, 0) {
    std::iota(next_.begin(), next_.end(), 0);
    image_of_.reserve(first_keypoint.back());
    for (size_t image = 0; image + 1 < first_keypoint.size(); ++image)
      image_of_.insert(image_of_.end(), first_keypoint[image + 1] - first_keypoint[image],
                       static_cast<int32_t>(image));
  }

  // To be called some time before Union(): most of its time is spent on waiting for memory.
  void Prefetch(int32_t keypoint) const {
    sets_.Prefetch(keypoint);
    __builtin_prefetch(&next_[keypoint]);
    __builtin_prefetch(&image_of_[keypoint]);
  }

  // False when the two sets hold different keypoints of one image.
  bool Union(int32_t keypoint1, int32_t keypoint2) {
    const int root1 = sets_.Find(keypoint1), root2 = sets_.Find(keypoint2);
    if (root1 == root2) return true;
    ++num_looks_;
    ForEach(root1, [&](int32_t keypoint) { seen_[image_of_[keypoint]] = num_looks_; });
    bool is_conflict = false;
    ForEach(root2, [&](int32_t keypoint) { is_conflict |= seen_[image_of_[keypoint]] == num_looks_; });
    if (is_conflict) return false;
    sets_.Join(root1, root2);
    std::swap(next_[root1], next_[root2]);  // of two rings one
    return true;
  }

  std::vector<Track> Tracks() {
    std::vector<Track> tracks;
    for (int32_t root = 0; root < std::ssize(next_); ++root) {
      if (next_[root] == root || sets_.Find(root) != root) continue;
      Track& track = tracks.emplace_back();
      ForEach(root, [&](int32_t keypoint) {
        const int32_t image = image_of_[keypoint];
        track.push_back({image, static_cast<KeypointIdx>(keypoint - first_keypoint_[image])});
      });
      std::sort(track.begin(), track.end());
      track.shrink_to_fit();
    }
    return tracks;
  }

 private:
  template <typename Visit>
  void ForEach(int32_t first, const Visit& visit) const {
    int32_t keypoint = first;
    do {
      visit(keypoint);
      keypoint = next_[keypoint];
    } while (keypoint != first);
  }

  const std::vector<int32_t>& first_keypoint_;
  DisjointSets sets_;
  std::vector<int32_t> next_;      // of its set, all around
  std::vector<int32_t> image_of_;  // per keypoint
  std::vector<int64_t> seen_;      // per image: when last
  int64_t num_looks_ = 0;
};

}  // namespace

Result<std::vector<Track>> UnionMatches(ScoredMatches matches, int64_t* num_conflicts) {
  const std::vector<int32_t> first_keypoint = matches.first_keypoint();
  TrackSets sets(first_keypoint);
  *num_conflicts = 0;
  constexpr size_t kNumAhead = 32;
  std::array<ScoredMatches::Match, kNumAhead> ahead;
  size_t num_visited = 0;
  const auto unite = [&](const ScoredMatches::Match& match) {
    // [Sala06 §VI-B] keypoints are equivalent where verified matches join them, not by their distance alone
    if (!sets.Union(match.keypoint1, match.keypoint2)) ++*num_conflicts;
  };
  CAIRN_RETURN_IF_ERROR(std::move(matches).Visit([&](const ScoredMatches::Match& match) {
    ScoredMatches::Match& next = ahead[num_visited % kNumAhead];
    if (num_visited++ >= kNumAhead) unite(next);
    next = match;
    sets.Prefetch(match.keypoint1);
    sets.Prefetch(match.keypoint2);
  }));
  for (size_t i = num_visited - std::min(num_visited, kNumAhead); i < num_visited; ++i)
    unite(ahead[i % kNumAhead]);
  return sets.Tracks();
}

}  // namespace cairn
