#include "runtime/track/expected_features.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/blocks/map_rows.h"
#include "core/camera/pixel_ray.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

// Coarse features are matched with landmarks that look this much smaller, too: neither their sizes nor the
// distance are known exactly.
constexpr double kSmallerRatio = 1.5;
// Largest ratio of a feature's scale to the expected one, or of its inverse.
constexpr double kMaxScaleRatio = 1.6;

// A landmark where a pose puts it in the image.
struct Sight {
  Eigen::Vector2d pixel;
  double radius_px = 0;
  double scale_px = 0;
};

// Sights in square cells, for those near a keypoint.
class Sights {
 public:
  Sights(const Camera& camera, double cell_px)
      : cell_px_(cell_px),
        num_columns_(static_cast<int>(camera.width / cell_px) + 1),
        num_rows_(static_cast<int>(camera.height / cell_px) + 1),
        cells_(static_cast<size_t>(num_columns_) * num_rows_) {}

  // In each cell that the circle around it touches.
  void Add(const Sight& sight) {
    const auto cell = [&](double at, int count) {
      return std::clamp(static_cast<int>(std::floor(at / cell_px_)), 0, count - 1);
    };
    for (int row = cell(sight.pixel.y() - sight.radius_px, num_rows_);
         row <= cell(sight.pixel.y() + sight.radius_px, num_rows_); ++row) {
      for (int column = cell(sight.pixel.x() - sight.radius_px, num_columns_);
           column <= cell(sight.pixel.x() + sight.radius_px, num_columns_); ++column)
        cells_[static_cast<size_t>(row) * num_columns_ + column].push_back(sight);
    }
  }

  bool HasLike(const Keypoint& keypoint) const {
    const int row = std::clamp(static_cast<int>(keypoint.y / cell_px_), 0, num_rows_ - 1);
    const int column = std::clamp(static_cast<int>(keypoint.x / cell_px_), 0, num_columns_ - 1);
    const auto& cell = cells_[static_cast<size_t>(row) * num_columns_ + column];
    return std::any_of(cell.begin(), cell.end(), [&](const Sight& sight) {
      const double dx = keypoint.x - sight.pixel.x(), dy = keypoint.y - sight.pixel.y();
      return dx * dx + dy * dy <= sight.radius_px * sight.radius_px &&
             keypoint.scale <= kMaxScaleRatio * sight.scale_px &&
             sight.scale_px <= kMaxScaleRatio * keypoint.scale;
    });
  }

 private:
  double cell_px_;
  int num_columns_;
  int num_rows_;
  std::vector<std::vector<Sight>> cells_;
};

// Those that coarse features show.
std::vector<LandmarkIdx> CoarseOf(const LandmarkSet& landmarks, const Pose& cam_from_world,
                                  const Query& query) {
  std::vector<LandmarkIdx> coarse;
  for (size_t i = 0; i < landmarks.idx.size(); ++i) {
    const MapLandmark& landmark = landmarks.landmarks[i];
    const double depth = DepthOfScale(query.camera, cam_from_world * landmark.position);
    if (landmark.scale_m <= 0 || WasLookedFor(landmark, depth / kSmallerRatio, query))
      coarse.push_back(landmarks.idx[i]);
  }
  return coarse;
}

// Where the pose puts those that fine features show.
Sights FineSights(const LandmarkSet& landmarks, const Pose& cam_from_world, const Query& coarse,
                  double radius_px) {
  constexpr double kNumSigmas = 3;
  Sights sights(coarse.camera, std::max(16.0, 2 * radius_px));
  const double focal_px = coarse.camera.MeanFocal();
  const double max_radius_px = std::hypot(coarse.camera.width, coarse.camera.height);
  for (const MapLandmark& landmark : landmarks.landmarks) {
    const Eigen::Vector3d point = cam_from_world * landmark.position;
    const auto pixel = ImageFromCamera(coarse.camera, point);
    const double depth = DepthOfScale(coarse.camera, point);
    if (!pixel || !IsInImage(*pixel, coarse.camera) || landmark.scale_m <= 0 || depth <= 0) continue;
    const double scale_px = landmark.scale_m * focal_px / depth;
    if (scale_px > kMaxScaleRatio * coarse.min_scale_px) continue;
    const double own_px = kNumSigmas * focal_px / depth * std::sqrt(landmark.covariance.trace() / 3);
    sights.Add({*pixel, std::min(std::hypot(radius_px, own_px), max_radius_px), scale_px});
  }
  return sights;
}

}  // namespace

Result<Localization> LocalizeExpected(const Map& map, const Localizer& localizer, const cv::Mat& grey,
                                      const Camera& camera, const std::vector<LandmarkIdx>& expected,
                                      const PosePrior& prior, const ExpectedFeaturesOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(expected, false));
  const bool has_sizes = std::any_of(landmarks->landmarks.begin(), landmarks->landmarks.end(),
                                     [](const MapLandmark& landmark) { return landmark.scale_m > 0; });
  if (!has_sizes) {
    return Localization{.reason = NoFix::kTooFewMatches,
                        .message = fmt::format("of {} landmarks the size is not known", expected.size())};
  }
  CAIRN_ASSIGN_OR_RETURN(Query query, localizer.CoarseQueryFromImage(grey, camera));
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
  const Sights sights =
      FineSights(*landmarks, camera_from_given * found.cam_from_world, query, options.fine_radius_px);
  CAIRN_RETURN_IF_ERROR(localizer.AddFineFeatures(
      grey, options.max_num_fine_features, [&](const Keypoint& keypoint) { return sights.HasLike(keypoint); },
      &query));
  return localizer.Sharpen(query, *landmarks, std::move(found));
}

}  // namespace cairn
