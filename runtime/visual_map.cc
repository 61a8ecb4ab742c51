#include "runtime/visual_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "core/descriptor_matcher.h"
#include "core/floor_pose.h"
#include "core/median.h"
#include "core/visual_map.h"
#include "runtime/no_throw.h"
#include "runtime/visual_fit.h"

namespace cairn {
namespace {

// Stations nearer than this are at one place.
constexpr double kSamePlaceM = 0.01;
constexpr double kGuessedFocal = 1.2;  // of the longer side

// Survey images that are left out to learn what errors share, of how many landmarks each, and how many one
// needs.
constexpr size_t kNumLeftOutImages = 40, kNumOfLeftOutImage = 40, kMinNumOfImage = 8;

double MedianSpacing(const std::vector<Eigen::Vector2d>& places) {
  std::vector<double> nearest;
  for (size_t i = 0; i < places.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < places.size(); ++k) {
      if (k != i) least = std::min(least, (places[k] - places[i]).norm());
    }
    nearest.push_back(least);
  }
  return nearest.size() < 2 ? 1 : Median(nearest);
}

}  // namespace

OptionTable DescribeOptions(VisualMapOptions* o) {
  return {{.name = "extent_spacings",
           .value = &o->extent_spacings,
           .help = "visual map: a model counts this far from the places that saw its landmark, in spacings "
                   "of the survey",
           .min = 0},
          {.name = "visual_max_ratio",
           .value = &o->visual_max_ratio,
           .help = "visual map: largest ratio of best to second-best descriptor angle, both ways",
           .min = 1e-3,
           .max = 1},
          {.name = "visual_max_angle_rad",
           .value = &o->visual_max_angle_rad,
           .help = "visual map: largest descriptor angle of a match, radians",
           .min = 1e-3}};
}

Result<std::shared_ptr<const VisualMap>> VisualMap::Load(const Map& map, const VisualMapOptions& options) {
  return WithoutExceptions("visual map", [&]() -> Result<std::shared_ptr<const VisualMap>> {
    VisualMapOptions checked = options;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    CAIRN_ASSIGN_OR_RETURN(const VisualMapData data, map.LandmarkModels());
    std::shared_ptr<VisualMap> visual(new VisualMap());
    visual->options_ = options;
    const auto camera = std::find_if(map.head().cameras.begin(), map.head().cameras.end(),
                                     [&](const Camera& c) { return c.camera_id == data.camera_id; });
    if (camera == map.head().cameras.end()) {
      return MakeError(ErrorCode::kCorrupt, "map '{}': its visual map is of camera {}, which it lacks",
                       map.head().name, data.camera_id);
    }
    visual->width_px_ = camera->width;
    visual->height_px_ = camera->height;
    visual->has_learnt_focal_ = data.focal_px > 0;
    visual->focal_px_ =
        data.focal_px > 0 ? data.focal_px : kGuessedFocal * std::max(camera->width, camera->height);
    visual->headings_deg_ = data.headings_deg;
    CAIRN_RETURN_IF_ERROR(visual->AddPlaces(map));
    CAIRN_RETURN_IF_ERROR(visual->AddModels(map, data));
    visual->FillExtents();
    visual->LearnSharedError(data);
    visual->sights_.clear();
    CAIRN_ASSIGN_OR_RETURN(visual->landmarks_, map.AllLandmarks());
    return std::shared_ptr<const VisualMap>(std::move(visual));
  });
}

Status VisualMap::AddPlaces(const Map& map) {
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kStations); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Stations(ordinal));
    for (const MapStation& station : block->stations) {
      const bool is_known = std::any_of(places_.begin(), places_.end(), [&](const Eigen::Vector2d& place) {
        return (place - station.position).norm() < kSamePlaceM;
      });
      if (!is_known) places_.push_back(station.position);
    }
  }
  if (places_.empty())
    return MakeError(ErrorCode::kCorrupt, "map '{}': a visual map without stations", map.head().name);
  spacing_m_ = MedianSpacing(places_);
  return Ok();
}

Status VisualMap::AddModels(const Map& map, const VisualMapData& data) {
  const Pose given_from_camera = map.head().camera_from_given.Inverse();
  std::vector<Eigen::Vector2d> image_places;
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (const MapImage& image : block->images) {
      image_places.push_back(
          FloorPoseOf(given_from_camera * image.cam_from_world, map.head().floor_from_world).position);
    }
  }
  models_of_landmark_.resize(data.landmarks.size());
  for (size_t landmark = 0; landmark < data.landmarks.size(); ++landmark) {
    for (const HeadingModel& stored : data.landmarks[landmark]) {
      std::vector<Sight> sights;
      for (const LandmarkSight& sight : stored.sights) {
        Eigen::Vector3d seen = sight.seen.cast<double>();
        seen.head<2>() -= middle_px();
        sights.push_back({image_places[sight.image], seen});
      }
      auto model = LandmarkModel::Make(sights, stored.shape);
      if (!model) {
        return MakeError(ErrorCode::kCorrupt, "map '{}': the {} sights of landmark {} make no model",
                         map.head().name, sights.size(), landmark);
      }
      models_of_landmark_[landmark].push_back(static_cast<int32_t>(models_.size()));
      models_.push_back({static_cast<LandmarkIdx>(landmark),
                         stored.heading,
                         std::move(*model),
                         stored.sigma,
                         stored.predicts_badly,
                         {}});
      sights_.push_back(std::move(sights));
    }
  }
  return Ok();
}

void VisualMap::FillExtents() {
  // Half a spacing at least: places of stations are not exactly those of their images.
  const double reach_m = std::max(0.5, options_.extent_spacings) * spacing_m_ * (1 + 1e-6);
  for (size_t i = 0; i < models_.size(); ++i) {
    Model& model = models_[i];
    for (int32_t place = 0; place < static_cast<int32_t>(places_.size()); ++place) {
      const bool is_near = std::any_of(sights_[i].begin(), sights_[i].end(), [&](const Sight& sight) {
        return (sight.place - places_[place]).norm() <= reach_m;
      });
      if (!is_near) continue;
      const LandmarkModel::Prediction prediction = model.interpolation.Predict(places_[place]);
      model.extent.push_back({place, prediction.seen, prediction.gradient});
    }
  }
}

void VisualMap::LearnSharedError(const VisualMapData& data) {
  // Models by image, and the sight of the image in each.
  std::map<int32_t, std::vector<std::pair<size_t, size_t>>> of_image;
  size_t model = 0;
  for (const std::vector<HeadingModel>& models : data.landmarks) {
    for (const HeadingModel& stored : models) {
      for (size_t i = 0; i < stored.sights.size() && !stored.predicts_badly; ++i)
        of_image[stored.sights[i].image].emplace_back(model, i);
      ++model;
    }
  }
  std::erase_if(of_image, [](const auto& image) { return image.second.size() < kMinNumOfImage; });
  std::vector<double> squared_m, squared_rad, chance_m, chance_rad;
  const size_t step = std::max<size_t>(1, of_image.size() / kNumLeftOutImages);
  size_t next = 0;
  for (const auto& [image, in_models] : of_image) {
    if (next++ % step != 0) continue;
    const auto found = PlaceLeftOut(in_models, data);
    if (!found) continue;
    squared_m.push_back(found->first.head<2>().squaredNorm() / 2);
    squared_rad.push_back(found->first[2] * found->first[2]);
    chance_m.push_back((found->second(0, 0) + found->second(1, 1)) / 2);
    chance_rad.push_back(found->second(2, 2));
  }
  if (squared_m.empty()) return;
  // Medians of chi squared: 2 ln 2 of two degrees of freedom, 0.455 of one.
  shared_sigma_m_ = std::sqrt(std::max(0.0, Median(squared_m) / std::numbers::ln2 - Median(chance_m)));
  shared_sigma_rad_ = std::sqrt(std::max(0.0, Median(squared_rad) / 0.455 - Median(chance_rad)));
}

std::optional<std::pair<Eigen::Vector3d, Eigen::Matrix3d>> VisualMap::PlaceLeftOut(
    const std::vector<std::pair<size_t, size_t>>& in_models, const VisualMapData& data) const {
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  constexpr double kTiltWeight = 1 / (0.035 * 0.035);
  Matrix5d normal = Eigen::Matrix<double, 5, 1>(1e-4, 1e-4, 1e-4, kTiltWeight, kTiltWeight).asDiagonal();
  Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero();
  const size_t step = std::max<size_t>(1, in_models.size() / kNumOfLeftOutImage);
  for (size_t k = 0; k < in_models.size(); k += step) {
    const auto& [index, sight] = in_models[k];
    const Model& model = models_[index];
    const auto& of_landmark = data.landmarks[model.landmark];
    const auto stored = std::find_if(of_landmark.begin(), of_landmark.end(),
                                     [&](const HeadingModel& m) { return m.heading == model.heading; });
    const auto errors = LandmarkModel::LeaveOneOutErrors(sights_[index], stored->shape);
    if (!errors) continue;
    const Sight& at = sights_[index][sight];
    const FitItem item{.seen = at.seen, .predicted = at.seen, .variance = Eigen::Vector3d::Ones()};
    Eigen::Vector3d unused;
    Eigen::Matrix3d by_turn;
    if (!ItemError(item, Eigen::Matrix3d::Identity(), focal_px_, &unused, &by_turn)) continue;
    Eigen::Matrix<double, 3, 5> jacobian;
    jacobian << model.interpolation.Predict(at.place).gradient, by_turn;
    const Eigen::Vector3d error = errors->col(static_cast<Eigen::Index>(sight));
    const Eigen::Vector3d variance = model.sigma.cwiseAbs2() + Eigen::Vector3d(1, 1, 0.02);
    // Errors of many standard deviations are no part of it.
    if ((error.array().square() / variance.array()).sum() > 25) continue;
    normal += jacobian.transpose() * variance.cwiseInverse().asDiagonal() * jacobian;
    gradient += jacobian.transpose() * variance.cwiseInverse().asDiagonal() * error;
  }
  const Matrix5d covariance = normal.inverse();
  if (!covariance.allFinite()) return std::nullopt;
  const Eigen::Matrix<double, 5, 1> off = covariance * gradient;
  return std::pair<Eigen::Vector3d, Eigen::Matrix3d>(off.head<3>(), covariance.topLeftCorner<3, 3>());
}

Result<std::vector<SeenLandmark>> VisualMap::Match(const Query& query) const {
  if (query.camera.width != width_px_ || query.camera.height != height_px_) {
    return MakeError(ErrorCode::kUnsupported,
                     "visual map: an image of {} x {} px; it knows images of the survey's camera, {} x {} px",
                     query.camera.width, query.camera.height, width_px_, height_px_);
  }
  std::vector<SeenLandmark> seen;
  for (const cairn::Match& match : MatchDescriptors(query.packed, landmarks_->packed,
                                                    {.max_ratio = options_.visual_max_ratio,
                                                    .max_angle_rad = options_.visual_max_angle_rad,
                                                    .mutual = true})) {
    const Keypoint& keypoint = query.features.keypoints[match.idx1];
    seen.push_back(
        {landmarks_->idx[match.idx2], {keypoint.x, keypoint.y, std::log2(std::max(keypoint.scale, 1e-3F))}});
  }
  return seen;
}

}  // namespace cairn
