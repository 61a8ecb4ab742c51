#include "stages/emit_map/learn_visual_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/geometry/floor_pose.h"
#include "runtime/visual_map/visual_estimate.h"

namespace cairn::emit_map {
namespace {

constexpr double kReachSpacings = 1.05;
// Models extend from the diagonal neighbours, the nearest ones left on a lattice, to the tested place.
constexpr double kExtentSpacings = 1.5;
// Largest number of images tried, and smallest numbers needed.
constexpr size_t kNumImages = 80, kMinNumImages = 8, kMinNumSeen = 8;
constexpr size_t kNumModels = 400, kNumSightsOfModel = 12, kMinNumOfModel = 8;
constexpr double kUnknownSpacings = 0.5, kUnknownDeg = 5;
// Nine of ten squares of normal numbers, and mean squares of three, lie below.
constexpr double kNineOfTen1 = 2.706, kNineOfTen2 = 4.605, kNineOfTen3 = 2.084;
// Errors by rounding, added to models' variances: px, px, octaves.
const Eigen::Vector3d kRounding(0.01, 0.01, 1e-4);

// Every step-th makes at most about `count` of `size`.
size_t StepFor(size_t size, size_t count) { return std::max<size_t>(1, size / count); }

class Learner {
 public:
  Learner(const Classes& classes, const MapRows& rows, const VisualMapData& data)
      : data_(data), seen_(rows.images.size()) {
    for (const Camera& camera : rows.cameras) {
      if (camera.camera_id != data.camera_id) continue;
      survey_.width_px = camera.width;
      survey_.height_px = camera.height;
    }
    std::vector<Eigen::Vector2d> stations;
    for (const MapStation& station : rows.stations) stations.push_back(station.position);
    survey_.places = DistinctPlaces(stations);
    const Pose given_from_camera = rows.camera_from_given.Inverse();
    std::map<ImageId, int32_t> image_of_id;
    for (const MapImage& image : rows.images) {
      if (image.camera_id == data.camera_id)
        image_of_id[image.image_id] = static_cast<int32_t>(poses_.size());
      const Pose cam_from_world = given_from_camera * image.cam_from_world;
      poses_.push_back(FloorPoseOf(cam_from_world, rows.floor_from_world));
      survey_.images.push_back(poses_.back().position);
      survey_.heights_m.push_back((rows.floor_from_world * cam_from_world.Center()).z());
    }
    std::map<ClassId, const FeatureClass*> class_of_id;
    for (const FeatureClass& feature : classes.classes) class_of_id[feature.class_id] = &feature;
    for (size_t landmark = 0; landmark < rows.landmarks.size(); ++landmark) {
      const auto feature = class_of_id.find(rows.landmarks[landmark].class_id);
      if (feature == class_of_id.end()) continue;
      for (const Observation& observation : feature->second->observations) {
        const auto image = image_of_id.find(observation.image_id);
        if (image == image_of_id.end()) continue;
        const Keypoint& keypoint = observation.keypoint;
        seen_[image->second].push_back(
            {static_cast<LandmarkIdx>(landmark),
             {keypoint.x, keypoint.y, std::log2(std::max(keypoint.scale, 1e-3F))}});
      }
    }
  }

  Result<VisualErrors> Run(int num_threads) {
    errors_ = data_.errors;
    CAIRN_ASSIGN_OR_RETURN(const auto map, VisualMap::Make(WithoutModels(), survey_));
    reach_m_ = kReachSpacings * map->spacing_m();
    errors_.growth_per_m = static_cast<float>(LearnGrowth());
    errors_.shared_m = static_cast<float>(kUnknownSpacings * map->spacing_m());
    errors_.shared_rad = static_cast<float>(RadFromDeg(kUnknownDeg));
    LearnShared(num_threads);
    return errors_;
  }

 private:
  struct Try {
    double squared_m = 0, squared_rad = 0;  // errors
    double own_m = 0, own_rad = 0;          // variances that landmarks' own errors give, per axis
  };

  VisualMapData WithoutModels() const {
    VisualMapData data;
    data.camera_id = data_.camera_id;
    data.focal_px = data_.focal_px;
    data.headings_deg = data_.headings_deg;
    data.errors.growth_per_m = errors_.growth_per_m;
    data.errors.tilt_rad = errors_.tilt_rad;
    return data;
  }

  // From the errors of predicted single sights, in units of their models' standard deviations.
  double LearnGrowth() const {
    std::vector<const HeadingModel*> models;
    for (const std::vector<HeadingModel>& of_landmark : data_.landmarks) {
      for (const HeadingModel& model : of_landmark) {
        if (!model.predicts_badly && model.sights.size() >= kMinNumOfModel) models.push_back(&model);
      }
    }
    std::vector<double> ratios;
    double sum = 0;  // of squared distances
    for (size_t i = 0; i < models.size(); i += StepFor(models.size(), kNumModels)) {
      const std::vector<Sight> sights = SightsOf(*models[i]);
      for (size_t k = 0; k < sights.size(); k += StepFor(sights.size(), kNumSightsOfModel)) {
        std::vector<Sight> rest;
        double nearest_m = std::numeric_limits<double>::infinity();
        for (const Sight& sight : sights) {
          const double distance_m = (sight.place - sights[k].place).norm();
          if (distance_m <= reach_m_) continue;
          rest.push_back(sight);
          nearest_m = std::min(nearest_m, distance_m);
        }
        const auto model = LandmarkModel::Make(rest, models[i]->shape);
        if (!model) continue;
        const Eigen::Vector3d error = model->Predict(sights[k].place).seen - sights[k].seen;
        const Eigen::Vector3d variance = models[i]->sigma.cwiseAbs2() + kRounding;
        ratios.push_back((error.array().square() / variance.array()).mean());
        sum += nearest_m * nearest_m;
      }
    }
    if (ratios.empty()) return 0;
    const double squared_m = sum / static_cast<double>(ratios.size());
    return std::sqrt(std::max(0.0, Decile(ratios, 9) / kNineOfTen3 - 1) / squared_m);
  }

  std::vector<Sight> SightsOf(const HeadingModel& model) const {
    std::vector<Sight> sights;
    for (const LandmarkSight& sight : model.sights) {
      Eigen::Vector3d seen = sight.seen.cast<double>();
      seen.head<2>() -= 0.5 * Eigen::Vector2d(survey_.width_px, survey_.height_px);
      sights.push_back({survey_.images[sight.image], seen});
    }
    return sights;
  }

  void LearnShared(int num_threads) {
    std::vector<int32_t> images;
    for (size_t i = 0; i < seen_.size(); ++i) {
      if (seen_[i].size() >= kMinNumSeen) images.push_back(static_cast<int32_t>(i));
    }
    const size_t step = StepFor(images.size(), kNumImages);
    std::vector<std::optional<Try>> tries((images.size() + step - 1) / step);
    ParallelFor(static_cast<int64_t>(tries.size()), num_threads,
                [&](int64_t i) { tries[i] = PlaceWithoutNeighbours(images[i * step]); });
    std::vector<double> squared_m, squared_rad, own_m, own_rad;
    for (const std::optional<Try>& tried : tries) {
      if (!tried) continue;
      squared_m.push_back(tried->squared_m);
      squared_rad.push_back(tried->squared_rad);
      own_m.push_back(tried->own_m);
      own_rad.push_back(tried->own_rad);
    }
    if (squared_m.size() < kMinNumImages) return;
    const double of_m = Decile(squared_m, 9) / kNineOfTen2 - UpperMedian(own_m);
    const double of_rad = Decile(squared_rad, 9) / kNineOfTen1 - UpperMedian(own_rad);
    errors_.shared_m = static_cast<float>(std::sqrt(std::max(0.0, of_m)));
    errors_.shared_rad = static_cast<float>(std::sqrt(std::max(0.0, of_rad)));
  }

  std::optional<Try> PlaceWithoutNeighbours(int32_t image) const {
    const FloorPose& truth = poses_[image];
    const auto is_near = [&](const Eigen::Vector2d& at) { return (at - truth.position).norm() <= reach_m_; };
    VisualMapData data = WithoutModels();
    std::vector<SeenLandmark> seen;
    for (const SeenLandmark& match : seen_[image]) {
      std::vector<HeadingModel> models = data_.landmarks[match.landmark];
      for (HeadingModel& model : models)
        std::erase_if(model.sights, [&](const auto& sight) { return is_near(survey_.images[sight.image]); });
      std::erase_if(models, [&](const HeadingModel& model) {
        return !LandmarkModel::Make(SightsOf(model), model.shape);
      });
      if (models.empty()) continue;
      seen.push_back({static_cast<LandmarkIdx>(data.landmarks.size()), match.seen});
      data.landmarks.push_back(std::move(models));
    }
    const auto map = VisualMap::Make(data, survey_, {.extent_spacings = kExtentSpacings});
    if (!map.ok()) return std::nullopt;
    const Result<VisualPose> pose = EstimateVisualPose(**map, seen);
    if (!pose.ok() || pose->flag != VisualFlag::kNone) return std::nullopt;
    const double turn_rad = RadFromDeg(AngleBetweenDeg(pose->heading_deg, truth.heading_deg));
    const double growth = SharedGrowth(pose->spread_ratio);
    return Try{(pose->position - truth.position).squaredNorm() / (growth * growth),
               turn_rad * turn_rad / (growth * growth), 0.5 * pose->covariance.topLeftCorner<2, 2>().trace(),
               pose->covariance(2, 2)};
  }

  const VisualMapData& data_;
  VisualErrors errors_;
  VisualSurvey survey_;
  std::vector<FloorPose> poses_;                 // per image
  std::vector<std::vector<SeenLandmark>> seen_;  // per image
  double reach_m_ = 0;
};

}  // namespace

Result<VisualErrors> LearnVisualErrors(const Classes& classes, const MapRows& rows, const VisualMapData& data,
                                       int num_threads) {
  return Learner(classes, rows, data).Run(num_threads);
}

}  // namespace cairn::emit_map
