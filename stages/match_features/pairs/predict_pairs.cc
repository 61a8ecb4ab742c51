#include "stages/match_features/pairs/predict_pairs.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/parallel.h"
#include "core/geometry/pose.h"
#include "core/geometry/two_view_error.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::match_features {

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
  const std::span matches = std::span(matches_).subspan(first_match);
  for (const auto& [f, h] : matches) {
    ++links.begin[f + 2];
    ++links.begin[h + 2];
  }
  for (size_t f = 2; f < links.begin.size(); ++f) links.begin[f] += links.begin[f - 1];
  links.feature.resize(2 * matches.size());
  links.view.resize(2 * matches.size());
  for (const auto& [f, h] : matches) {
    links.view[links.begin[f + 1]] = view_of_[h];
    links.view[links.begin[h + 1]] = view_of_[f];
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

std::vector<char> PairPredictor::NewlyLinked(int idx, const Links& links, const Links& new_links) const {
  std::vector<char> linked(views_.size(), 0);
  const auto follow = [&](uint32_t f, const Links& first, const Links& second) {
    for (uint64_t i = first.begin[f]; i < first.begin[f + 1]; ++i) {
      const uint32_t middle = first.feature[i];
      for (uint64_t k = second.begin[middle]; k < second.begin[middle + 1]; ++k) linked[second.view[k]] = 1;
    }
  };
  for (uint32_t f = first_feature_[idx]; f < first_feature_[idx + 1]; ++f) {
    follow(f, new_links, links);
    follow(f, links, new_links);
  }
  return linked;
}

std::vector<int> PairPredictor::ExpectedMatches(int idx, const Links& links, const std::vector<char>& settled,
                                                const PredictPairsOptions& options) const {
  const auto min_cosine = static_cast<float>(std::cos(RadFromDeg(options.max_ray_angle_deg)));
  std::vector<int> expected(views_.size(), 0);
  std::vector<uint32_t> counted(views_.size(), 0);  // the last feature that was, plus one
  for (uint32_t f = first_feature_[idx]; f < first_feature_[idx + 1]; ++f) {
    const Eigen::Vector3f& ray = Ray(f);
    for (uint64_t i = links.begin[f]; i < links.begin[f + 1]; ++i) {
      const uint32_t middle = links.feature[i];
      const int generation = views_[links.view[i]].generation;
      for (uint64_t k = links.begin[middle]; k < links.begin[middle + 1]; ++k) {
        const int other = links.view[k];
        if (settled[other] || counted[other] == f + 1) continue;
        if (generation > std::max(views_[idx].generation, views_[other].generation)) continue;
        const uint32_t h = links.feature[k];
        if (ray.dot(Ray(h)) < min_cosine || !CanMeet(f, h, options)) continue;
        counted[other] = f + 1;
        ++expected[other];
      }
    }
  }
  return expected;
}

Result<std::vector<PredictedPair>> PairPredictor::Predict(const IndexPairs& known,
                                                          const PredictPairsOptions& options, int num_threads,
                                                          Progress& progress) {
  const int num_views = static_cast<int>(views_.size());
  const Links links = CollectLinks(0);
  const bool is_first = num_predicted_from_ == 0;
  const Links new_links = is_first ? Links() : CollectLinks(num_predicted_from_);
  std::vector<std::vector<PredictedPair>> predicted(views_.size());
  progress.Begin("predict pairs", num_views, "images");
  ParallelFor(num_views, num_threads, [&](int64_t i) {
    if (progress.Cancelled()) return;
    const int idx = static_cast<int>(i);
    std::vector<char> settled(views_.size(), 0);
    if (!is_first) {
      settled = NewlyLinked(idx, links, new_links);
      for (char& flag : settled) flag = flag == 0;
    }
    std::fill(settled.begin(), settled.begin() + idx + 1, 1);
    for (auto it = std::lower_bound(known.begin(), known.end(), std::pair(idx, 0));
         it != known.end() && it->first == idx; ++it) {
      settled[it->second] = 1;
    }
    if (std::find(settled.begin(), settled.end(), 0) != settled.end()) {
      const std::vector<int> expected = ExpectedMatches(idx, links, settled, options);
      for (int other = idx + 1; other < num_views; ++other) {
        if (expected[other] >= options.min_num_expected_matches)
          predicted[i].push_back({{idx, other}, expected[other]});
      }
    }
    progress.Advance();
  });
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while predicting pairs");
  num_predicted_from_ = matches_.size();
  std::vector<PredictedPair> pairs;
  for (const std::vector<PredictedPair>& part : predicted)
    pairs.insert(pairs.end(), part.begin(), part.end());
  return pairs;
}

}  // namespace cairn::match_features
