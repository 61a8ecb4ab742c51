#include "runtime/track/expected_features.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/blocks/map_rows.h"
#include "core/camera/pixel_ray.h"
#include "core/work/work_budget.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// Largest ratio of a feature's scale to the expected one, or of its inverse.
constexpr double kMaxScaleRatio = 1.6;

// How far a landmark may appear from where it is expected because places are not well known, radii.
constexpr double kMaxRadii = 4;

// A landmark where a pose puts it in the image.
struct ExpectedSight {
  Eigen::Vector2d pixel;
  double radius_px = 0;
  double scale_px = 0;
};

bool IsLike(const Keypoint& keypoint, const ExpectedSight& sight) {
  const double dx = keypoint.x - sight.pixel.x(), dy = keypoint.y - sight.pixel.y();
  const double scale_ratio = keypoint.scale / sight.scale_px;
  return dx * dx + dy * dy <= sight.radius_px * sight.radius_px && scale_ratio <= kMaxScaleRatio &&
         scale_ratio >= 1 / kMaxScaleRatio;
}

// Whether a keypoint is like one of these sights, which are ordered by column and whose radii are at most
// this.
bool IsLikeAny(const Keypoint& keypoint, std::span<const ExpectedSight> sights, double max_radius_px) {
  const auto first = std::partition_point(sights.begin(), sights.end(), [&](const ExpectedSight& sight) {
    return sight.pixel.x() < keypoint.x - max_radius_px;
  });
  for (auto sight = first; sight != sights.end() && sight->pixel.x() <= keypoint.x + max_radius_px; ++sight) {
    if (IsLike(keypoint, *sight)) return true;
  }
  return false;
}

// Those that coarse features show: no others, as what is found of them is held against what should be
// (PlaceEvidence).
PooledVector<LandmarkIdx> CoarseOf(const LandmarkSet& landmarks, const Pose& cam_from_world,
                                   const Query& query) {
  PooledVector<LandmarkIdx> coarse;
  coarse.reserve(landmarks.idx.size());
  for (size_t i = 0; i < landmarks.idx.size(); ++i) {
    const MapLandmark& landmark = landmarks.landmarks[i];
    const double depth = DepthOfScale(query.camera, cam_from_world * landmark.position);
    if (WasLookedFor(landmark, depth, query)) coarse.push_back(landmarks.idx[i]);
  }
  return coarse;
}

// Where the fix puts those that fine features show, ordered by column.
PooledVector<ExpectedSight> FineSights(const LandmarkSet& landmarks, const Localization& fix,
                                       const Pose& camera_from_given, const Query& coarse, double radius_px) {
  constexpr double kNumSigmas = 3;
  const Pose cam_from_world = camera_from_given * fix.cam_from_world;
  const double sigma_rad = LargestSigma(fix.covariance.topLeftCorner<3, 3>());
  const double sigma_m = LargestSigma(fix.covariance.bottomRightCorner<3, 3>());
  PooledVector<ExpectedSight> sights;
  sights.reserve(landmarks.landmarks.size());
  const double focal_px = coarse.camera.MeanFocal();
  for (const MapLandmark& landmark : landmarks.landmarks) {
    const Eigen::Vector3d point = cam_from_world * landmark.position;
    const auto pixel = PixelOf(coarse, point);
    if (!pixel || !IsInImage(*pixel, coarse.camera)) continue;
    const double pixels_per_m = focal_px / DepthOfScale(coarse.camera, point);
    const double scale_px = landmark.scale_m * pixels_per_m;
    if (scale_px > kMaxScaleRatio * coarse.min_scale_px) continue;
    const double sigma_px = std::hypot(pixels_per_m * std::sqrt(landmark.covariance.trace() / 3),
                                       pixels_per_m * sigma_m, focal_px * sigma_rad);
    const double reach_px = std::min(std::hypot(radius_px, kNumSigmas * sigma_px), kMaxRadii * radius_px);
    sights.push_back({*pixel, reach_px, scale_px});
  }
  std::sort(sights.begin(), sights.end(),
            [](const ExpectedSight& a, const ExpectedSight& b) { return a.pixel.x() < b.pixel.x(); });
  return sights;
}

}  // namespace

Result<Localization> LocalizeExpected(const Map& map, const Localizer& localizer, const QueryFrame& frame,
                                      std::span<const LandmarkIdx> expected, const PosePrior& prior,
                                      const ExpectedFeaturesOptions& options) {
  if (!Spend(frame.work().get(), Work::kLandmark, expected.size()))
    return Localization{.reason = NoFix::kOverBudget, .message = "no work is left (budget_ms)"};
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(expected, false));
  const auto num_of_unknown_size =
      std::count_if(landmarks->landmarks.begin(), landmarks->landmarks.end(),
                    [](const MapLandmark& landmark) { return landmark.scale_m <= 0; });
  if (2 * num_of_unknown_size >= static_cast<int64_t>(expected.size())) {
    return Localization{.reason = NoFix::kTooFewMatches,
                        .message = fmt::format("of {} of {} landmarks the size is not known",
                                               num_of_unknown_size, expected.size())};
  }
  CAIRN_ASSIGN_OR_RETURN(Query query,
                         localizer.CoarseQueryFromImage(*frame.image(), frame.camera(), frame.work()));
  if (frame.up()) CAIRN_RETURN_IF_ERROR(localizer.SetUp(*frame.up(), &query));
  query.readout = frame.ReadoutOf(prior.cam_from_world);
  const int num_features = static_cast<int>(query.features.keypoints.size());
  if (num_features < localizer.options().accept.min_num_features) {
    return Localization{.reason = NoFix::kTooFewFeatures,
                        .message = fmt::format("{} coarse features", num_features),
                        .num_features = num_features};
  }
  const Pose& camera_from_given = map.head().camera_from_given;
  CAIRN_ASSIGN_OR_RETURN(
      Localization found,
      localizer.LocalizeAmong(query, Scope::kTrack,
                              CoarseOf(*landmarks, camera_from_given * prior.cam_from_world, query), prior));
  if (!found.has_fix() || options.max_num_fine_features == 0) return found;
  query.readout = frame.ReadoutOf(found.cam_from_world);
  const PooledVector<ExpectedSight> sights =
      FineSights(*landmarks, found, camera_from_given, query, options.fine_radius_px);
  CAIRN_RETURN_IF_ERROR(localizer.AddFineFeatures(
      *frame.image(), options.max_num_fine_features,
      [&](const Keypoint& keypoint) {
        return IsLikeAny(keypoint, sights, kMaxRadii * options.fine_radius_px);
      },
      &query));
  if (static_cast<int>(query.features.keypoints.size()) == num_features) return found;
  return localizer.Sharpen(query, *landmarks, std::move(found));
}

}  // namespace cairn
