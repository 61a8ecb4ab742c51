#include "stages/match_features/predict_pairs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/pose.h"
#include "core/vector_geometry.h"
#include "stages/match_features/two_view_error.h"

namespace cairn {

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

PairPredictor::Links PairPredictor::CollectLinks() const {
  Links links;
  links.begin.resize(view_of_.size() + 2, 0);
  for (const auto& [f, h] : matches_) {
    ++links.begin[f + 2];
    ++links.begin[h + 2];
  }
  for (size_t f = 2; f < links.begin.size(); ++f) links.begin[f] += links.begin[f - 1];
  links.feature.resize(2 * matches_.size());
  for (const auto& [f, h] : matches_) {
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

std::vector<int> PairPredictor::ExpectedMatches(int idx, const Links& links, const std::vector<bool>& tried,
                                                const PredictPairsOptions& options) const {
  const auto min_cosine = static_cast<float>(std::cos(RadFromDeg(options.max_ray_angle_deg)));
  std::vector<int> expected(views_.size(), 0);
  std::vector<uint32_t> counted(views_.size(), 0);  // the last feature that was, plus one
  for (uint32_t f = first_feature_[idx]; f < first_feature_[idx + 1]; ++f) {
    const Eigen::Vector3f& ray = Ray(f);
    for (uint64_t i = links.begin[f]; i < links.begin[f + 1]; ++i) {
      const uint32_t middle = links.feature[i];
      for (uint64_t k = links.begin[middle]; k < links.begin[middle + 1]; ++k) {
        const uint32_t h = links.feature[k];
        const int other = view_of_[h];
        if (other <= idx || tried[other] || counted[other] == f + 1) continue;
        if (ray.dot(Ray(h)) < min_cosine || !CanMeet(f, h, options)) continue;
        counted[other] = f + 1;
        ++expected[other];
      }
    }
  }
  return expected;
}

Result<IndexPairs> PairPredictor::Predict(const IndexPairs& tried, const PredictPairsOptions& options,
                                          int num_threads, Progress& progress) const {
  const int num_views = static_cast<int>(views_.size());
  const Links links = CollectLinks();
  std::vector<IndexPairs> predicted(views_.size());
  progress.Begin("predict pairs", num_views, "images");
  ParallelFor(num_views, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const int idx = static_cast<int>(i);
    std::vector<bool> is_tried(views_.size(), false);
    for (auto it = std::lower_bound(tried.begin(), tried.end(), std::pair(idx, 0));
         it != tried.end() && it->first == idx; ++it) {
      is_tried[it->second] = true;
    }
    const std::vector<int> expected = ExpectedMatches(idx, links, is_tried, options);
    for (int other = idx + 1; other < num_views; ++other) {
      if (expected[other] >= options.min_num_expected_matches) predicted[i].emplace_back(idx, other);
    }
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while predicting pairs");
  IndexPairs pairs;
  for (const IndexPairs& part : predicted) pairs.insert(pairs.end(), part.begin(), part.end());
  return pairs;
}

}  // namespace cairn
