#include "core/vocabulary/rerank_places.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/features/descriptor_matcher.h"
#include "core/geometry/estimate_two_view.h"
#include "core/geometry/relative_pose.h"

namespace cairn {
namespace {

Correspondences FiniteMatches(const PlaceView& query, const PlaceView& candidate,
                              const RerankOptions& options) {
  const PooledVector<Match> matches =
      MatchDescriptors(query.packed, candidate.packed,
                       {.max_ratio = options.max_ratio, .max_angle_rad = options.max_angle_rad});
  Correspondences finite;
  for (size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector3d &bearing1 = query.bearings[matches[i].idx1],
                          &bearing2 = candidate.bearings[matches[i].idx2];
    if (bearing1.allFinite() && bearing2.allFinite()) finite.Add(bearing1, bearing2, static_cast<int>(i));
  }
  return finite;
}

Correspondences Inliers(const Eigen::Matrix3d& E, const Correspondences& c, double max_error_rad) {
  Correspondences inliers;
  for (int i = 0; i < c.size(); ++i) {
    if (SquaredSampsonError(E, c.bearings1[i], c.bearings2[i]) <= max_error_rad * max_error_rad)
      inliers.Add(c.bearings1[i], c.bearings2[i], c.match_idx[i]);
  }
  return inliers;
}

// A camera that only turned obeys any essential matrix with that rotation, and sampling finds none.
Correspondences TurnedInliers(const Correspondences& c, double max_error_rad) {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  for (const double scale_rad : {10.0, 0.1, max_error_rad})
    rotation = RefineRotation(rotation, c, scale_rad, 5);
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  Correspondences inliers;
  for (int i = 0; i < c.size(); ++i) {
    if (SquaredTransferError(R, c.bearings1[i], c.bearings2[i]) <= max_error_rad * max_error_rad)
      inliers.Add(c.bearings1[i], c.bearings2[i], c.match_idx[i]);
  }
  return inliers;
}

// Length 1 of the translation over the median distance from camera 1: d1 (R b1) x b2 = -t x b2.
double BaselineRatio(const Pose& cam2_from_cam1, const Correspondences& c) {
  std::vector<double> ratios;
  for (int i = 0; i < c.size(); ++i) {
    const Eigen::Vector3d ray1 = cam2_from_cam1.rotation * c.bearings1[i];
    const double across = cam2_from_cam1.translation.cross(c.bearings2[i]).norm();
    ratios.push_back(ray1.cross(c.bearings2[i]).norm() / std::max(across, 1e-9));
  }
  return UpperMedian(std::move(ratios));
}

}  // namespace

OptionTable DescribeOptions(RerankOptions* o) {
  return {
      {.name = "num_candidates",
       .value = &o->num_candidates,
       .help = "number of images that are verified: those most alike by their words",
       .min = 0},
      {.name = "max_ratio",
       .value = &o->max_ratio,
       .help = "largest ratio of best to second-best descriptor angle, both ways",
       .min = 1e-3,
       .max = 1},
      {.name = "max_angle_rad",
       .value = &o->max_angle_rad,
       .help = "largest descriptor angle of a match, radians",
       .min = 1e-3},
      {.name = "max_epipolar_error_px",
       .value = &o->max_epipolar_error_px,
       .help = "largest distance of an agreeing match from its epipolar line, px",
       .min = 1e-3},
      {.name = "min_num_inliers",
       .value = &o->min_num_inliers,
       .help = "an image with fewer agreeing matches is not verified",
       .min = 6},
      {.name = "baseline_ratio",
       .value = &o->baseline_ratio,
       .help = "baseline over median distance of what is seen at which the score falls to 1 / e",
       .min = 1e-3},
      {.name = "max_num_samples",
       .value = &o->max_num_samples,
       .help = "most samples of five matches",
       .min = 1},
  };
}

PlaceView MakePlaceView(const Features& features, const Camera& camera) {
  PlaceView view;
  for (const Keypoint& keypoint : features.keypoints) {
    view.bearings.push_back(
        BearingFromImage(camera, {keypoint.x, keypoint.y})
            .value_or(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())));
  }
  view.packed = PackedDescriptors(features.descriptors, features.kind.space());
  view.focal_px = camera.MeanFocal();
  return view;
}

RerankedPlace VerifyPlace(const PlaceView& query, const PlaceView& candidate, const RerankOptions& options) {
  RerankedPlace place;
  const Correspondences matches = FiniteMatches(query, candidate, options);
  if (matches.size() < options.min_num_inliers) return place;
  const double max_error_rad = options.max_epipolar_error_px / query.focal_px;
  const auto E = EstimateEssentialMatrix(matches, {max_error_rad, options.max_num_samples});
  Correspondences inliers = E ? Inliers(*E, matches, max_error_rad) : Correspondences();
  const Correspondences turned = TurnedInliers(matches, max_error_rad);
  const bool is_turned = turned.size() >= inliers.size();
  if (is_turned) inliers = turned;
  if (inliers.size() < options.min_num_inliers) return place;
  place.num_inliers = inliers.size();
  place.baseline_ratio = is_turned ? 0
                                   : BaselineRatio(RefineRelativePose(PoseFromEssentialMatrix(*E, inliers),
                                                                      inliers, max_error_rad / 2, 6),
                                                   inliers);
  place.score = inliers.size() /
                std::sqrt(static_cast<double>(query.packed.size()) * candidate.packed.size()) *
                std::exp(-place.baseline_ratio / options.baseline_ratio);
  return place;
}

Result<std::vector<RerankedPlace>> RerankPlaces(const PlaceView& query,
                                                const std::vector<const PlaceView*>& candidates,
                                                const RerankOptions& options, int num_threads) {
  RerankOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  std::vector<RerankedPlace> places(candidates.size());
  const auto num_verified = std::min<int64_t>(options.num_candidates, static_cast<int64_t>(places.size()));
  ParallelFor(num_verified, num_threads,
              [&](int64_t i) { places[i] = VerifyPlace(query, *candidates[i], options); });
  for (size_t i = 0; i < places.size(); ++i) places[i].candidate = static_cast<int>(i);
  std::stable_sort(places.begin(), places.end(), [](const RerankedPlace& a, const RerankedPlace& b) {
    return a.is_verified() != b.is_verified() ? a.is_verified() : a.score > b.score;
  });
  return places;
}

}  // namespace cairn
