#include "stages/match_features/pairs/predict_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "core/geometry/two_view_error.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::match_features {
namespace {

// Parts of the memory: of rays and of matches that are kept, and of those that Predict() looks at.
constexpr int64_t kKeptPart = 16, kNearPart = 2;

// A ray of a view.
struct ViewRay {
  const Eigen::Vector3d& center;
  double focal_px;
  const Eigen::Vector3f& ray;
};

bool CanMeet(const ViewRay& a, const ViewRay& b, const PredictPairsOptions& options) {
  const Eigen::Vector3d ray1 = a.ray.cast<double>(), ray2 = b.ray.cast<double>();
  const Eigen::Vector3d baseline = b.center - a.center;
  const double tolerance_rad = options.max_prior_error_px / (0.5 * (a.focal_px + b.focal_px));
  if (baseline.norm() < options.min_baseline_m) return (ray1 - ray2).norm() <= tolerance_rad;
  return SquaredSampsonError(CrossMatrix(baseline), ray1, ray2) <= tolerance_rad * tolerance_rad &&
         RaysConverge(ray1, ray2, baseline, tolerance_rad);
}

void Prefetch(std::span<const Neighbourhood::Link> links) {
  constexpr size_t kLineBytes = 64;
  for (size_t i = 0; i < links.size(); i += kLineBytes / sizeof(Neighbourhood::Link))
    __builtin_prefetch(links.data() + i);
}

}  // namespace

PairPredictor::PairPredictor(const std::string& beside, int64_t max_num_bytes)
    : matched_(beside, max_num_bytes / kKeptPart), max_num_bytes_(max_num_bytes) {}

void PairPredictor::AddView(const View& view) {
  places_.push_back({view.center, view.focal_px, view.generation});
  matched_.AddView(view.rays);
}

void PairPredictor::Add(int idx1, int idx2, const std::vector<Match>& inliers) {
  if (!inliers.empty()) matched_.AddPair(idx1, idx2, inliers);
}

std::vector<int> PairPredictor::ImagesToExamine(const std::set<int>& without) const {
  const std::vector<MatchedRays::Pair>& pairs = matched_.pairs();
  int first_changed = std::numeric_limits<int>::max();
  for (size_t i = num_predicted_from_; i < pairs.size(); ++i) {
    first_changed = std::min(
        first_changed, std::max(places_[pairs[i].view1].generation, places_[pairs[i].view2].generation));
  }
  std::vector<int> images;
  for (int idx = 0; idx < matched_.num_views(); ++idx) {
    const int generation = places_[idx].generation;
    if (generation >= first_changed && !without.contains(generation)) images.push_back(idx);
  }
  return images;
}

template <typename Visit>
void PairPredictor::VisitChains(int idx, bool only_new, const Neighbourhood& near, const Visit& visit) const {
  const Neighbourhood::LinkedView& from = near.At(near.SlotOf(idx));
  struct Ends {
    bool is_new;
    std::span<const Neighbourhood::Link> links;
  };
  constexpr size_t kAhead = 3;
  std::vector<Ends> ends;
  for (uint32_t f = 0; f < from.rays.size(); ++f) {
    ends.clear();
    for (const Neighbourhood::Link& middle : from.LinksOf(f)) {
      const Neighbourhood::LinkedView& to = near.At(middle.slot);
      const bool is_new = middle.is_new != 0;
      if (IsLater(near.ViewOf(middle.slot), idx)) continue;
      if (!only_new || is_new || to.has_new_link[middle.feature] != 0)
        ends.push_back({is_new, to.LinksOf(middle.feature)});
    }
    for (size_t k = 0; k < ends.size(); ++k) {
      // Links of one feature after the other are far from each other: most of the time is spent on waiting.
      if (k + kAhead < ends.size()) Prefetch(ends[k + kAhead].links);
      for (const Neighbourhood::Link& end : ends[k].links) visit(f, ends[k].is_new || end.is_new != 0, end);
    }
  }
}

std::vector<char> PairPredictor::NewlyLinked(int idx, const Neighbourhood& near) const {
  std::vector<char> linked(near.num_slots(), 0);
  VisitChains(idx, true, near, [&](uint32_t /*f*/, bool is_new, const Neighbourhood::Link& end) {
    linked[end.slot] |= static_cast<char>(is_new);
  });
  return linked;
}

std::vector<int> PairPredictor::ExpectedMatches(int idx, const std::vector<char>& settled,
                                                const Neighbourhood& near,
                                                const PredictPairsOptions& options) const {
  const auto min_cosine = static_cast<float>(std::cos(RadFromDeg(options.max_ray_angle_deg)));
  const Neighbourhood::LinkedView& from = near.At(near.SlotOf(idx));
  std::vector<int> expected(near.num_slots(), 0);
  // The matches of a pair are the features of its first image that have one: where that is not this one,
  // which they are, flags for all features of the images before it.  Of this one: the last feature that
  // counted, plus one; of images that are settled more than any.
  std::vector<uint32_t> counted(near.num_slots(), 0);
  std::vector<uint32_t> first_flag(near.num_slots());
  uint32_t num_flags = 0;
  for (int slot = 0; slot < near.num_slots(); ++slot) {
    if (settled[slot] != 0) {
      counted[slot] = std::numeric_limits<uint32_t>::max();
    } else if (near.ViewOf(slot) < idx) {
      first_flag[slot] = num_flags;
      num_flags += matched_.NumFeatures(near.ViewOf(slot));
    }
  }
  std::vector<bool> is_counted(num_flags);
  const auto ray_of = [&](int view, const Eigen::Vector3f& ray) {
    return ViewRay{places_[view].center, places_[view].focal_px, ray};
  };
  VisitChains(idx, false, near, [&](uint32_t f, bool /*is_new*/, const Neighbourhood::Link& end) {
    if (counted[end.slot] > f) return;
    const int other = near.ViewOf(end.slot);
    const bool is_first = idx < other;
    const uint32_t flag = first_flag[end.slot] + end.feature;
    if (!is_first && is_counted[flag]) return;
    const ViewRay here = ray_of(idx, from.rays[f]);
    const ViewRay there = ray_of(other, near.At(end.slot).rays[end.feature]);
    if (here.ray.dot(there.ray) < min_cosine) return;
    if (!(is_first ? CanMeet(here, there, options) : CanMeet(there, here, options))) return;
    if (is_first) {
      counted[end.slot] = f + 1;
    } else {
      is_counted[flag] = true;
    }
    ++expected[end.slot];
  });
  return expected;
}

std::vector<PredictedPair> PairPredictor::PredictFrom(int idx, const std::vector<int>& known,
                                                      const Neighbourhood& near,
                                                      const PredictPairsOptions& options) const {
  std::vector<char> settled(near.num_slots(), 0);
  if (num_predicted_from_ > 0) {
    settled = NewlyLinked(idx, near);
    for (char& flag : settled) flag = flag == 0;
  }
  for (int slot = 0; slot < near.num_slots(); ++slot) {
    const int other = near.ViewOf(slot);
    if (other < 0 || !IsFrom(idx, other) || std::binary_search(known.begin(), known.end(), other))
      settled[slot] = 1;
  }
  std::vector<PredictedPair> predicted;
  if (std::find(settled.begin(), settled.end(), 0) == settled.end()) return predicted;
  const std::vector<int> expected = ExpectedMatches(idx, settled, near, options);
  for (int slot = 0; slot < near.num_slots(); ++slot) {
    if (expected[slot] >= options.min_num_expected_matches)
      predicted.push_back({std::minmax(idx, near.ViewOf(slot)), expected[slot]});
  }
  return predicted;
}

Result<std::vector<PredictedPair>> PairPredictor::Predict(const IndexPairs& known,
                                                          const PredictPairsOptions& options, int num_threads,
                                                          Progress& progress, const std::set<int>& without) {
  CAIRN_RETURN_IF_ERROR(matched_.status());
  std::vector<PredictedPair> pairs;
  const size_t num_pairs = matched_.pairs().size();
  std::vector<int> images = ImagesToExamine(without);
  if (images.empty()) {
    num_predicted_from_ = num_pairs;
    return pairs;
  }
  Neighbourhood near(matched_, num_predicted_from_, max_num_bytes_ / kNearPart);
  std::erase_if(images, [&](int idx) { return !near.HasNewChain(idx); });
  std::vector<std::vector<int>> known_from(places_.size());  // ascending
  for (const auto& [idx1, idx2] : known) {
    const bool is_from_first = IsFrom(idx1, idx2);
    known_from[is_from_first ? idx1 : idx2].push_back(is_from_first ? idx2 : idx1);
  }
  progress.Begin("predict pairs", static_cast<int64_t>(images.size()), "images");
  for (size_t begin = 0, end = 0; begin < images.size() && !progress.Cancelled(); begin = end) {
    CAIRN_ASSIGN_OR_RETURN(end, near.MoveTo(images, begin, num_threads));
    std::vector<std::vector<PredictedPair>> predicted(end - begin);
    ParallelFor(static_cast<int64_t>(end - begin), num_threads, [&](int64_t i) {
      if (progress.Cancelled()) return;
      const int idx = images[begin + i];
      predicted[i] = PredictFrom(idx, known_from[idx], near, options);
      progress.Advance();
    });
    for (const std::vector<PredictedPair>& part : predicted)
      pairs.insert(pairs.end(), part.begin(), part.end());
  }
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while predicting pairs");
  num_predicted_from_ = num_pairs;
  std::sort(pairs.begin(), pairs.end(),
            [](const PredictedPair& a, const PredictedPair& b) { return a.idxs < b.idxs; });
  return pairs;
}

}  // namespace cairn::match_features
