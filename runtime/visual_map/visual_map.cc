#include "runtime/visual_map/visual_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/no_throw.h"
#include "core/base/quantiles.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/camera/camera_turn.h"
#include "core/features/descriptor_matcher.h"
#include "core/geometry/floor_pose.h"
#include "core/world/visual_map.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/block_cache.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

// Stations closer together than this are at one place.
constexpr double kSamePlaceM = 0.01;
constexpr double kGuessedFocal = 1.2;  // of the longer side

}  // namespace

std::vector<Eigen::Vector2d> DistinctPlaces(const std::vector<Eigen::Vector2d>& stations) {
  std::vector<Eigen::Vector2d> places;
  for (const Eigen::Vector2d& station : stations) {
    const bool is_known = std::any_of(places.begin(), places.end(), [&](const Eigen::Vector2d& place) {
      return (place - station).norm() < kSamePlaceM;
    });
    if (!is_known) places.push_back(station);
  }
  return places;
}

namespace {

double MedianSpacing(const std::vector<Eigen::Vector2d>& places) {
  std::vector<double> nearest;
  for (size_t i = 0; i < places.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < places.size(); ++k) {
      if (k != i) least = std::min(least, (places[k] - places[i]).norm());
    }
    nearest.push_back(least);
  }
  return nearest.size() < 2 ? 1 : UpperMedian(nearest);
}

double Deviation(const std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double sum = 0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / count);
}

Result<VisualSurvey> SurveyOf(const Map& map, CameraId camera_id) {
  VisualSurvey survey;
  const auto camera = std::find_if(map.head().cameras.begin(), map.head().cameras.end(),
                                   [&](const Camera& c) { return c.camera_id == camera_id; });
  if (camera == map.head().cameras.end()) {
    return MakeError(ErrorCode::kCorrupt, "map '{}': its visual map is of camera {}, which it lacks",
                     map.head().name, camera_id);
  }
  survey.width_px = camera->width;
  survey.height_px = camera->height;
  std::vector<Eigen::Vector2d> stations;
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kStations); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Stations(ordinal));
    for (const MapStation& station : block->stations) stations.push_back(station.position);
  }
  survey.places = DistinctPlaces(stations);
  const Pose given_from_camera = map.head().camera_from_given.Inverse();
  const Pose& floor_from_world = map.head().floor_from_world;
  survey.scale_sigma_ratio = map.head().frame.scale_sigma_ratio;
  survey.scale_centre = (floor_from_world * map.head().frame.scale_centre).head<2>();
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (const MapImage& image : block->images) {
      const Pose cam_from_world = given_from_camera * image.cam_from_world;
      survey.images.push_back(FloorPoseOf(cam_from_world, floor_from_world).position);
      survey.heights_m.push_back((floor_from_world * cam_from_world.Center()).z());
    }
  }
  return survey;
}

int64_t NumBytes(const VisualMap::Models& models) {
  int64_t num_bytes = sizeof(models);
  for (const VisualMap::Model& model : models) {
    // Of a sight: its place twice, and its weights.
    constexpr size_t kSightBytes = 2 * sizeof(Eigen::Vector2d) + sizeof(Eigen::Vector3d);
    num_bytes += static_cast<int64_t>(sizeof(model) + model.sight_places.size() * kSightBytes +
                                      model.extent.size() * sizeof(VisualMap::AtPlace));
  }
  return num_bytes;
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
           .min = 1e-3},
          {.name = "model_budget_mib",
           .value = &o->model_budget_mib,
           .help = "visual map: memory for models that stay ready for later images, MiB",
           .min = 0}};
}

struct VisualMap::Source {
  std::shared_ptr<const Map> map;
  VisualMapData survey;  // what all blocks repeat
  BlockCache cache;      // models by landmark
};

Result<std::shared_ptr<const VisualMap>> VisualMap::Open(std::shared_ptr<const Map> map,
                                                         const VisualMapOptions& options) {
  return WithoutExceptions("visual map", [&]() -> Result<std::shared_ptr<const VisualMap>> {
    if (!map->has_visual_map()) return map->LandmarkModels().error();
    CAIRN_ASSIGN_OR_RETURN(const auto block, map->LandmarkModels(0));
    VisualMapData of_all = block->part;
    of_all.landmarks.clear();
    CAIRN_ASSIGN_OR_RETURN(VisualSurvey survey, SurveyOf(*map, of_all.camera_id));
    auto made = MakeFrame(of_all, std::move(survey), options);
    if (!made.ok())
      return MakeError(made.error().code, "map '{}': {}", map->head().name, made.error().message);
    const std::shared_ptr<VisualMap> visual = *std::move(made);
    visual->num_landmarks_ = map->num_landmarks();
    visual->source_.reset(
        new Source{std::move(map), std::move(of_all), BlockCache(int64_t{options.model_budget_mib} << 20)});
    return std::shared_ptr<const VisualMap>(visual);
  });
}

Result<std::shared_ptr<const VisualMap>> VisualMap::Load(const Map& map, const VisualMapOptions& options) {
  return WithoutExceptions("visual map", [&]() -> Result<std::shared_ptr<const VisualMap>> {
    CAIRN_ASSIGN_OR_RETURN(const VisualMapData data, map.LandmarkModels());
    CAIRN_ASSIGN_OR_RETURN(VisualSurvey survey, SurveyOf(map, data.camera_id));
    auto made = MakeFull(data, std::move(survey), options);
    if (!made.ok())
      return MakeError(made.error().code, "map '{}': {}", map.head().name, made.error().message);
    const std::shared_ptr<VisualMap> visual = *std::move(made);
    CAIRN_ASSIGN_OR_RETURN(visual->landmarks_, map.AllLandmarks());
    return std::shared_ptr<const VisualMap>(visual);
  });
}

Result<std::shared_ptr<const VisualMap>> VisualMap::Make(const VisualMapData& data, VisualSurvey survey,
                                                         const VisualMapOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(auto visual, MakeFull(data, std::move(survey), options));
  return std::shared_ptr<const VisualMap>(std::move(visual));
}

Result<std::shared_ptr<VisualMap>> VisualMap::MakeFrame(const VisualMapData& data, VisualSurvey survey,
                                                        const VisualMapOptions& options) {
  VisualMapOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (survey.places.empty()) return MakeError(ErrorCode::kCorrupt, "a visual map without stations");
  std::shared_ptr<VisualMap> visual(new VisualMap());
  visual->options_ = options;
  visual->survey_ = std::make_shared<const VisualSurvey>(std::move(survey));
  visual->spacing_m_ = MedianSpacing(visual->places());
  visual->height_sigma_m_ = Deviation(visual->survey_->heights_m);
  visual->has_learnt_focal_ = data.focal_px > 0;
  visual->focal_px_ = data.focal_px > 0
                          ? data.focal_px
                          : kGuessedFocal * std::max(visual->image_width_px(), visual->image_height_px());
  visual->errors_ = data.errors;
  visual->headings_deg_ = data.headings_deg;
  return visual;
}

Result<std::shared_ptr<VisualMap>> VisualMap::MakeFull(const VisualMapData& data, VisualSurvey survey,
                                                       const VisualMapOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<VisualMap> visual, MakeFrame(data, std::move(survey), options));
  visual->num_landmarks_ = static_cast<int64_t>(data.landmarks.size());
  for (LandmarkIdx landmark = 0; landmark < visual->num_landmarks_; ++landmark) {
    CAIRN_ASSIGN_OR_RETURN(auto models, visual->MakeModels(landmark, data.landmarks[landmark]));
    visual->models_of_landmark_.emplace(landmark, std::move(models));
  }
  return visual;
}

Result<std::shared_ptr<const VisualMap::Models>> VisualMap::MakeModels(
    LandmarkIdx landmark, const std::vector<HeadingModel>& stored) const {
  auto models = std::make_shared<Models>();
  for (const HeadingModel& of_heading : stored) {
    std::vector<Sight> sights;
    for (const LandmarkSight& sight : of_heading.sights) {
      Eigen::Vector3d seen = sight.seen.cast<double>();
      seen.head<2>() -= middle_px();
      sights.push_back({survey_->images[sight.image], seen});
    }
    auto interpolation = LandmarkModel::Make(sights, of_heading.shape);
    if (!interpolation) {
      return MakeError(ErrorCode::kCorrupt, "the {} sights of landmark {} do not determine a model",
                       sights.size(), landmark);
    }
    models->push_back({landmark, of_heading.heading, std::move(*interpolation), of_heading.sigma,
                       of_heading.predicts_badly});
    Model& model = models->back();
    for (const Sight& sight : sights) model.sight_places.push_back(sight.place);
    FillExtent(&model);
  }
  return std::shared_ptr<const Models>(std::move(models));
}

Result<std::shared_ptr<const VisualMap::Models>> VisualMap::LoadModels(LandmarkIdx landmark) const {
  if (auto kept = source_->cache.Find(landmark)) return std::static_pointer_cast<const Models>(kept);
  const Map& map = *source_->map;
  const std::string what = "map '" + map.head().name + "'";
  CAIRN_ASSIGN_OR_RETURN(const auto block,
                         map.LandmarkModels(map.directory().OrdinalOf(BlockKind::kLandmarkModels, landmark)));
  CAIRN_RETURN_IF_ERROR(CheckSameSurvey(*block, source_->survey, what));
  auto models = MakeModels(landmark, block->part.landmarks[landmark - block->first]);
  if (!models.ok()) return MakeError(models.error().code, "{}: {}", what, models.error().message);
  const int64_t num_bytes = NumBytes(**models);
  return std::static_pointer_cast<const Models>(
      source_->cache.Insert(landmark, *std::move(models), num_bytes));
}

const VisualMap::Models& VisualMap::ModelsOf(LandmarkIdx landmark) const {
  static const Models kNone;
  const auto found = models_of_landmark_.find(landmark);
  return found == models_of_landmark_.end() ? kNone : *found->second;
}

Result<std::shared_ptr<const VisualMap>> VisualMap::With(const std::vector<LandmarkIdx>& landmarks) const {
  if (!source_) return std::shared_ptr<const VisualMap>(std::shared_ptr<const VisualMap>(), this);
  std::shared_ptr<VisualMap> with(new VisualMap(*this));
  for (const LandmarkIdx landmark : landmarks) {
    if (with->models_of_landmark_.contains(landmark)) continue;
    CAIRN_ASSIGN_OR_RETURN(auto models, LoadModels(landmark));
    with->models_of_landmark_.emplace(landmark, std::move(models));
  }
  return std::shared_ptr<const VisualMap>(std::move(with));
}

int64_t VisualMap::num_model_bytes() const {
  if (source_) return source_->cache.num_bytes();
  int64_t num_bytes = 0;
  for (const auto& [landmark, models] : models_of_landmark_) num_bytes += NumBytes(*models);
  return num_bytes;
}

Eigen::Vector3d VisualMap::Variance(const Model& model, const Eigen::Vector2d& position) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& place : model.sight_places)
    nearest = std::min(nearest, (place - position).squaredNorm());
  return (1 + errors_.growth_per_m * errors_.growth_per_m * nearest) * model.sigma.cwiseAbs2();
}

void VisualMap::FillExtent(Model* model) const {
  // Half a spacing at least: places of stations are not exactly those of their images.
  const double reach_m = std::max(0.5, options_.extent_spacings) * spacing_m_ * (1 + 1e-6);
  for (int32_t place = 0; place < static_cast<int32_t>(places().size()); ++place) {
    const bool is_near = std::any_of(
        model->sight_places.begin(), model->sight_places.end(),
        [&](const Eigen::Vector2d& sight) { return (sight - places()[place]).norm() <= reach_m; });
    if (!is_near) continue;
    const LandmarkModel::Prediction prediction = model->interpolation.Predict(places()[place]);
    model->extent.push_back({place, prediction.seen, prediction.gradient, Variance(*model, places()[place]),
                             RiseOf(prediction.gradient, RadFromDeg(headings_deg_[model->heading]))});
  }
}

Result<std::vector<SeenLandmark>> VisualMap::Match(const Query& query) const {
  if (landmarks_) return MatchWith(query, *landmarks_);
  if (!source_) return std::vector<SeenLandmark>();
  CAIRN_ASSIGN_OR_RETURN(const auto all, source_->map->AllLandmarks());
  return MatchWith(query, *all);
}

Result<std::vector<SeenLandmark>> VisualMap::MatchAmong(const Query& query,
                                                        std::span<const LandmarkIdx> landmarks) const {
  if (!source_) {
    CAIRN_ASSIGN_OR_RETURN(std::vector<SeenLandmark> seen, Match(query));
    std::erase_if(seen, [&](const SeenLandmark& match) {
      return !std::binary_search(landmarks.begin(), landmarks.end(), match.landmark);
    });
    return seen;
  }
  CAIRN_ASSIGN_OR_RETURN(const auto some, source_->map->Gather(landmarks, true));
  return MatchWith(query, *some);
}

Result<std::vector<SeenLandmark>> VisualMap::MatchWith(const Query& query,
                                                       const LandmarkSet& landmarks) const {
  if (query.camera.width != image_width_px() || query.camera.height != image_height_px()) {
    return MakeError(ErrorCode::kUnsupported,
                     "visual map: an image of {} x {} px; it knows images of the survey's camera, {} x {} px",
                     query.camera.width, query.camera.height, image_width_px(), image_height_px());
  }
  std::vector<SeenLandmark> seen;
  for (const cairn::Match& match : MatchDescriptors(query.packed, landmarks.packed,
                                                    {.max_ratio = options_.visual_max_ratio,
                                                    .max_angle_rad = options_.visual_max_angle_rad,
                                                    .mutual = true})) {
    const Keypoint& keypoint = query.features.keypoints[match.idx1];
    seen.push_back(
        {landmarks.idx[match.idx2], {keypoint.x, keypoint.y, std::log2(std::max(keypoint.scale, 1e-3F))}});
  }
  return seen;
}

}  // namespace cairn
