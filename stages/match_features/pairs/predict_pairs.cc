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

// Moves whole[begin, end) back by as many as stand before `added_begin`, and puts added[added_begin,
// added_end) after it.
template <typename T>
void MoveAndInsert(uint64_t begin, uint64_t end, const std::vector<T>& added, uint64_t added_begin,
                   uint64_t added_end, std::vector<T>* whole) {
  T* const moved_end = whole->data() + end + added_begin;
  std::move_backward(whole->data() + begin, whole->data() + end, moved_end);
  std::copy(added.data() + added_begin, added.data() + added_end, moved_end);
}

}  // namespace

PairPredictor::PairPredictor(std::vector<View> views) : views_(std::move(views)) {
  first_feature_.push_back(0);
  for (size_t idx = 0; idx < views_.size(); ++idx) {
    view_of_.insert(view_of_.end(), views_[idx].rays.size(), static_cast<int>(idx));
    first_feature_.push_back(static_cast<uint32_t>(view_of_.size()));
  }
}

void PairPredictor::Add(int idx1, int idx2, const std::vector<Match>& inliers) {
  for (const Match& match : inliers)
    matches_.emplace_back(first_feature_[idx1] + match.idx1, first_feature_[idx2] + match.idx2);
}

PairPredictor::Links PairPredictor::CollectLinks(size_t first_match) const {
  Links links;
  links.begin.resize(view_of_.size() + 2, 0);
  const std::span matches = std::span(matches_).subspan(first_match - num_forgotten_);
  for (const auto& [f, h] : matches) {
    ++links.begin[f + 2];
    ++links.begin[h + 2];
  }
  for (size_t f = 2; f < links.begin.size(); ++f) links.begin[f] += links.begin[f - 1];
  links.feature.resize(2 * matches.size());
  for (const auto& [f, h] : matches) {
    links.feature[links.begin[f + 1]++] = h;
    links.feature[links.begin[h + 1]++] = f;
  }
  return links;
}

bool PairPredictor::CanMeet(uint32_t feature1, uint32_t feature2, const PredictPairsOptions& options) const {
  const View &view1 = views_[view_of_[feature1]], &view2 = views_[view_of_[feature2]];
  const Eigen::Vector3d ray1 = Ray(feature1).cast<double>(), ray2 = Ray(feature2).cast<double>();
  const Eigen::Vector3d baseline = view2.center - view1.center;
  const double tolerance_rad = options.max_prior_error_px / (0.5 * (view1.focal_px + view2.focal_px));
  if (baseline.norm() < options.min_baseline_m) return (ray1 - ray2).norm() <= tolerance_rad;
  return SquaredSampsonError(CrossMatrix(baseline), ray1, ray2) <= tolerance_rad * tolerance_rad &&
         RaysConverge(ray1, ray2, baseline, tolerance_rad);
}

void PairPredictor::LinkAll() {
  Links added = CollectLinks(num_linked_);
  num_linked_ = num_matches();
  if (links_.feature.empty()) {
    links_ = std::move(added);
    return;
  }
  // From the last feature on, so that nothing is overwritten that is still to be moved.
  links_.feature.reserve(links_.feature.size() + added.feature.size());  // no more than that
  links_.feature.resize(links_.feature.size() + added.feature.size());
  for (size_t f = view_of_.size(); f-- > 0;) {
    const uint64_t begin = links_.begin[f], end = links_.begin[f + 1];
    const uint64_t added_begin = added.begin[f], added_end = added.begin[f + 1];
    MoveAndInsert(begin, end, added.feature, added_begin, added_end, &links_.feature);
  }
  for (size_t f = 0; f < links_.begin.size(); ++f) links_.begin[f] += added.begin[f];
}

std::vector<char> PairPredictor::ImagesToExamine(const std::set<int>& without) const {
  const bool is_first = num_predicted_from_ == 0;
  int first_changed = std::numeric_limits<int>::max();
  for (size_t i = num_predicted_from_ - num_forgotten_; i < matches_.size(); ++i) {
    const auto& [f, h] = matches_[i];
    first_changed =
        std::min(first_changed, std::max(views_[view_of_[f]].generation, views_[view_of_[h]].generation));
  }
  std::vector<char> to_examine;
  for (const View& view : views_)
    to_examine.push_back(
        !without.contains(view.generation) && (is_first || view.generation >= first_changed) ? 1 : 0);
  return to_examine;
}

std::vector<char> PairPredictor::NewlyLinked(int idx, const Links& new_links) const {
  std::vector<char> linked(views_.size(), 0);
  const auto follow = [&](uint32_t f, const Links& first, const Links& second) {
    for (uint64_t i = first.begin[f]; i < first.begin[f + 1]; ++i) {
      const uint32_t middle = first.feature[i];
      if (views_[view_of_[middle]].generation > views_[idx].generation) continue;
      for (uint64_t k = second.begin[middle]; k < second.begin[middle + 1]; ++k)
        linked[view_of_[second.feature[k]]] = 1;
    }
  };
  for (uint32_t f = first_feature_[idx]; f < first_feature_[idx + 1]; ++f) {
    follow(f, new_links, links_);
    follow(f, links_, new_links);
  }
  return linked;
}

std::vector<int> PairPredictor::ExpectedMatches(int idx, const std::vector<char>& settled,
                                                const PredictPairsOptions& options) const {
  const auto min_cosine = static_cast<float>(std::cos(RadFromDeg(options.max_ray_angle_deg)));
  std::vector<int> expected(views_.size(), 0);
  // The matches of a pair are the features of its first image that have one: where that is not this one,
  // which they are.  Of this one: the last feature that counted, plus one.
  std::vector<uint32_t> counted(views_.size(), 0);
  std::vector<bool> is_counted(idx > 0 ? first_feature_[idx] : 0);
  for (uint32_t f = first_feature_[idx]; f < first_feature_[idx + 1]; ++f) {
    const Eigen::Vector3f& ray = Ray(f);
    for (uint64_t i = links_.begin[f]; i < links_.begin[f + 1]; ++i) {
      const uint32_t middle = links_.feature[i];
      if (views_[view_of_[middle]].generation > views_[idx].generation) continue;
      for (uint64_t k = links_.begin[middle]; k < links_.begin[middle + 1]; ++k) {
        const uint32_t h = links_.feature[k];
        const int other = view_of_[h];
        if (settled[other] || counted[other] == f + 1) continue;
        const bool is_first = idx < other;
        if (!is_first && is_counted[h]) continue;
        if (ray.dot(Ray(h)) < min_cosine) continue;
        if (!(is_first ? CanMeet(f, h, options) : CanMeet(h, f, options))) continue;
        if (is_first) {
          counted[other] = f + 1;
        } else {
          is_counted[h] = true;
        }
        ++expected[other];
      }
    }
  }
  return expected;
}

Result<std::vector<PredictedPair>> PairPredictor::Predict(const IndexPairs& known,
                                                          const PredictPairsOptions& options, int num_threads,
                                                          Progress& progress, const std::set<int>& without) {
  const int num_views = static_cast<int>(views_.size());
  const std::vector<char> to_examine = ImagesToExamine(without);
  std::vector<PredictedPair> pairs;
  const bool is_first = num_predicted_from_ == 0;
  if (std::find(to_examine.begin(), to_examine.end(), 1) == to_examine.end()) {
    num_predicted_from_ = num_matches();
    return pairs;
  }
  LinkAll();
  const Links new_links = is_first ? Links() : CollectLinks(num_predicted_from_);
  num_forgotten_ = num_matches();
  std::vector<std::pair<uint32_t, uint32_t>>().swap(matches_);
  std::vector<std::vector<int>> known_from(views_.size());
  for (const auto& [idx1, idx2] : known) {
    const bool is_from_first = IsFrom(idx1, idx2);
    known_from[is_from_first ? idx1 : idx2].push_back(is_from_first ? idx2 : idx1);
  }
  std::vector<std::vector<PredictedPair>> predicted(views_.size());
  progress.Begin("predict pairs", num_views, "images");
  ParallelFor(num_views, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const int idx = static_cast<int>(i);
    progress.Advance();
    if (to_examine[idx] == 0) return;
    std::vector<char> settled(views_.size(), 0);
    if (!is_first) {
      settled = NewlyLinked(idx, new_links);
      for (char& flag : settled) flag = flag == 0;
    }
    for (int other = 0; other < num_views; ++other) {
      if (!IsFrom(idx, other)) settled[other] = 1;
    }
    for (const int other : known_from[idx]) settled[other] = 1;
    if (std::find(settled.begin(), settled.end(), 0) == settled.end()) return;
    const std::vector<int> expected = ExpectedMatches(idx, settled, options);
    for (int other = 0; other < num_views; ++other) {
      if (expected[other] >= options.min_num_expected_matches)
        predicted[i].push_back({std::minmax(idx, other), expected[other]});
    }
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while predicting pairs");
  num_predicted_from_ = num_matches();
  for (const std::vector<PredictedPair>& part : predicted)
    pairs.insert(pairs.end(), part.begin(), part.end());
  std::sort(pairs.begin(), pairs.end(),
            [](const PredictedPair& a, const PredictedPair& b) { return a.idxs < b.idxs; });
  return pairs;
}

}  // namespace cairn::match_features
