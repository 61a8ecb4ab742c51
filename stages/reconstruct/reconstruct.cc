#include "stages/reconstruct/reconstruct.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>
#include <utility>

#include "core/base/text.h"
#include "core/files/write_error.h"
#include "stages/reconstruct/find_frame.h"
#include "stages/reconstruct/globally/map_globally.h"
#include "stages/reconstruct/odometry.h"
#include "stages/reconstruct/register_to_others.h"
#include "stages/reconstruct/uneven_steps.h"
#include "stages/reconstruct/zoomed_lens.h"

namespace cairn::reconstruct {
namespace {

// All at once, this many times as many images as by COLMAP are many more.
constexpr double kManyMore = 1.1;
// Of images in no order, COLMAP is asked, too, where fewer are joined.
constexpr double kMinJoinedRatio = 0.8;

size_t NumRegistered(const Result<std::vector<ColmapModel>>& models) {
  return models.ok() ? models->front().images.size() : 0;
}

// One run of COLMAP's mapper.
struct MapperAttempt {
  const char* folder;
  const char* name;    // of the images that it registers, in a warning
  const char* remedy;  // what makes it the first attempt; may be empty
  MapperOptions options;
};

// How COLMAP is run until enough images are registered.  Distortion and shape cannot be distinguished from
// two images: the second attempt is without.  Along a street all pairs are of forward motion and small
// angles, which COLMAP does not start from: the third starts from any pair.
std::vector<MapperAttempt> Attempts(const MapperOptions& options) {
  std::vector<MapperAttempt> attempts;
  MapperOptions simpler = options;
  simpler.refine_distortion = false;
  if (options.refine_distortion) {
    attempts.push_back({"first", "by COLMAP with the cameras' distortion refined", "", options});
    attempts.push_back(
        {"without_distortion", "without", ": refine_distortion = false saves the first attempt", simpler});
  } else {
    attempts.push_back({"first", "by COLMAP without distortion", "", options});
  }
  simpler.start_from_any_pair = true;
  attempts.push_back({"from_any_pair", "from a start of any motion", "", simpler});
  return attempts;
}

// The models of COLMAP's attempt that registers most images.
Result<std::vector<ColmapModel>> MapByColmap(const MapperInput& input, const Capture& capture,
                                             const ReconstructOptions& options,
                                             const std::string& work_folder, Progress& progress,
                                             std::vector<std::string>* warnings) {
  const double num_wanted = options.min_registered_ratio * static_cast<double>(input.images.size());
  Result<std::vector<ColmapModel>> best = MakeError(ErrorCode::kNoData, "");
  std::string counts;
  const std::vector<MapperAttempt> attempts = Attempts(options.mapper);
  const MapperAttempt* taken = attempts.data();
  for (const MapperAttempt& attempt : attempts) {
    const bool is_first = &attempt == attempts.data();
    const std::string folder = work_folder + "/" + attempt.folder;
    std::error_code error;
    if (!std::filesystem::create_directory(folder, error))
      return WriteError(folder, "cannot be created", error.value());
    Result<std::vector<ColmapModel>> models =
        RunMapper(input, capture.images_folder, attempt.options, folder, progress);
    if (!models.ok() && models.error().code != ErrorCode::kNoData &&
        (is_first || models.error().code == ErrorCode::kCancelled)) {
      return models;
    }
    const size_t num_registered = NumRegistered(models);
    counts += is_first ? fmt::format("{} of {} images were registered {}", num_registered,
                                     input.images.size(), attempt.name)
                       : fmt::format(", {} {}", num_registered, attempt.name);
    if (is_first || num_registered > NumRegistered(best)) {
      best = std::move(models);
      taken = &attempt;
    }
    if (static_cast<double>(NumRegistered(best)) >= num_wanted && best.ok()) {
      if (!is_first) {
        warnings->push_back(
            fmt::format("{}; the reconstruction is the one {}{}", counts, taken->name, taken->remedy));
      }
      return best;
    }
  }
  warnings->push_back(fmt::format("{}; the reconstruction is the one {}", counts, taken->name));
  return best;
}

// By the mapper that the options name, or that suits the images.
Result<std::vector<ColmapModel>> MapImages(const MapperInput& input, const Capture& capture,
                                           const ReconstructOptions& options, const std::string& work_folder,
                                           int num_threads, Progress& progress, ReconstructResult* result) {
  const MapperOptions& mapper = options.mapper;
  if (mapper.mapper == "colmap")
    return MapByColmap(input, capture, options, work_folder, progress, &result->warnings);
  CAIRN_ASSIGN_OR_RETURN(std::vector<ImageMotion> motions, OdometryMotions(input, capture));
  const bool has_odometry = !motions.empty();
  Result<GlobalMap> global = MapGlobally(
      input, std::move(motions),
      {.refine_focal_length = mapper.refine_focal_length, .refine_distortion = mapper.refine_distortion},
      num_threads, progress);
  if (!global.ok() && global.error().code != ErrorCode::kNoData) return global.error();
  if (global.ok() && !global->why_no_odometry.empty()) {
    result->warnings.push_back(
        fmt::format("{}/{}: {}: it does not help to find the images' places; check where it says that the "
                    "camera is on the robot, and that its poses are those of the images",
                    capture.root, kOdometryFile, global->why_no_odometry));
  }
  if (global.ok() && global->is_drive && !has_odometry) {
    const std::string uneven = UnevenSteps(global->models.front());
    if (!uneven.empty()) result->warnings.push_back(fmt::format("{}: {}", capture.root, uneven));
  }
  const auto num_global = global.ok() ? static_cast<double>(global->models.front().images.size()) : 0;
  const bool is_enough =
      num_global >= options.min_registered_ratio * static_cast<double>(input.images.size());
  const bool is_whole = num_global >= kMinJoinedRatio * static_cast<double>(input.images.size());
  if (global.ok() && is_enough && (mapper.mapper == "global" || global->is_drive || is_whole))
    return global->models;
  std::vector<std::string> warnings;
  Result<std::vector<ColmapModel>> by_colmap =
      MapByColmap(input, capture, options, work_folder, progress, &warnings);
  if (!by_colmap.ok() && by_colmap.error().code == ErrorCode::kCancelled) return by_colmap;
  const auto num_by_colmap = static_cast<double>(NumRegistered(by_colmap));
  if (!global.ok() || num_by_colmap * kManyMore >= num_global) {
    if (!by_colmap.ok() && !global.ok()) return global.error();
    result->warnings.insert(result->warnings.end(), warnings.begin(), warnings.end());
    return by_colmap;
  }
  result->warnings.push_back(fmt::format(
      "{} of {} images were registered all at once, by COLMAP {}; the reconstruction is the first{}",
      num_global, input.images.size(),
      by_colmap.ok() ? fmt::format("{}", num_by_colmap) : "none: " + by_colmap.error().message,
      is_enough ? ": mapper = \"global\" saves the second" : ""));
  return global->models;
}

// Why an image is not in the model kept.
std::string RejectReason(ImageId image_id, const MapperInput& input, const std::vector<ColmapModel>& models,
                         const std::set<ImageId>& registered) {
  for (size_t m = 1; m < models.size(); ++m) {
    for (const ModelImage& image : models[m].images) {
      if (image.image_id == image_id) {
        return fmt::format("not registered with the others: in a separate part of {} images",
                           models[m].images.size());
      }
    }
  }
  size_t num_pairs = 0, most = 0;
  for (const TwoViewGeometry& geometry : input.geometries) {
    const bool joins = (geometry.image_id1 == image_id && registered.count(geometry.image_id2) > 0) ||
                       (geometry.image_id2 == image_id && registered.count(geometry.image_id1) > 0);
    if (!joins) continue;
    ++num_pairs;
    most = std::max(most, geometry.inliers.size());
  }
  if (num_pairs == 0)
    return fmt::format("not registered: no {} verified matches with any registered image", kMinNumMatches);
  return fmt::format("not registered: {} pairs with registered images, of at most {} matches, gave no pose",
                     num_pairs, most);
}

void CollectRejects(const MapperInput& input, const std::vector<ColmapModel>& models,
                    ReconstructResult* result) {
  std::set<ImageId> registered;
  for (const ModelImage& image : models[0].images) registered.insert(image.image_id);
  for (const DatabaseImage& image : input.images) {
    if (registered.count(image.image_id) > 0) continue;
    result->rejects.push_back({image.name, RejectReason(image.image_id, input, models, registered)});
  }
}

// Which images are joined with each other, the largest parts.
std::string PartsText(const std::vector<ColmapModel>& models) {
  std::string text;
  for (size_t m = 0; m < std::min<size_t>(models.size(), 5); ++m) {
    std::vector<std::string> names;
    for (const ModelImage& image : models[m].images) names.push_back(image.name);
    const std::vector<int> order = NaturalOrder(names);
    text += fmt::format("\n  {} images, {} to {}", names.size(), names[order.front()], names[order.back()]);
  }
  return text;
}

Status CheckRegistered(const MapperInput& input, const std::vector<ColmapModel>& models,
                       const ReconstructOptions& options, ReconstructResult* result) {
  const size_t num_images = input.images.size(), num_registered = num_images - result->rejects.size();
  if (num_registered == num_images) return Ok();
  const std::string text = fmt::format(
      "only {} of {} images were registered ({:.0f} %); models of {} images", num_registered, num_images,
      100.0 * static_cast<double>(num_registered) / num_images, fmt::join(result->model_sizes, ", "));
  if (static_cast<double>(num_registered) >= options.min_registered_ratio * num_images) {
    result->warnings.push_back(text + "; the largest is kept");
    return Ok();
  }
  std::string reasons;
  for (size_t i = 0; i < std::min<size_t>(result->rejects.size(), 5); ++i)
    reasons += fmt::format("\n  {}: {}", result->rejects[i].name, result->rejects[i].reason);
  return MakeError(ErrorCode::kNoData,
                   "{}, below min_registered_ratio = {:g}; take images that join the parts, or more features "
                   "per image (extract_features: max_num_features); a lower ratio accepts the largest part. "
                   "The parts:{}\nThe first missing images:{}",
                   text, options.min_registered_ratio, PartsText(models), reasons);
}

void CollectImages(const ColmapModel& model, const Similarity& world_from_model, int hold_out_every,
                   ReconstructResult* result) {
  result->cameras = model.cameras;
  std::vector<CaptureImage> images;
  for (const ModelImage& image : model.images)
    images.push_back({image.name, image.camera_id, TransformPose(world_from_model, image.cam_from_world)});
  std::sort(images.begin(), images.end(),
            [](const CaptureImage& a, const CaptureImage& b) { return a.name < b.name; });
  for (size_t i = 0; i < images.size(); ++i) {
    const bool is_held_out = hold_out_every > 0 && (i + 1) % static_cast<size_t>(hold_out_every) == 0;
    (is_held_out ? result->queries : result->images).push_back(std::move(images[i]));
  }
}

// How much there is of the models, the kept one first.
void CountModels(const std::vector<ColmapModel>& models, ReconstructResult* result) {
  for (const ColmapModel& m : models) result->model_sizes.push_back(static_cast<int>(m.images.size()));
  const std::vector<ModelPoint>& points = models[0].points;
  result->num_points = static_cast<int>(points.size());
  for (const ModelPoint& point : points)
    result->mean_error_px += point.error_px / static_cast<double>(points.size());
}

Verdict JudgeModels(const std::vector<ColmapModel>& models, const Similarity& world_from_model,
                    const ReconstructResult& result) {
  JudgedModels judged{.models = &models,
                      .cam_from_world = {},
                      .rejects = result.rejects,
                      .is_metric = IsMetric(result.frame)};
  for (const ModelImage& image : models[0].images)
    judged.cam_from_world.push_back(TransformPose(world_from_model, image.cam_from_world));
  return Judge(judged, {});
}

Status CheckReconstructOptions(const ReconstructOptions& options) {
  ReconstructOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  for (const auto& [scale_from, key, file] :
       {std::tuple("control_points", "control_points", &options.control_points),
        std::tuple("distances", "distances", &options.distances),
        std::tuple("rig", "rig_baselines", &options.rig_baselines)}) {
    if (options.scale_from == scale_from && file->empty()) {
      return MakeError(ErrorCode::kInvalidArgument, "scale_from = {}, but no file {} is given", scale_from,
                       key);
    }
  }
  if (options.scale_from == "camera_height" && options.camera_height_m == 0) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "scale_from = camera_height, but no camera_height_m is given: how high the camera is over "
        "the floor, metres");
  }
  if (options.hold_out_every == 1)
    return MakeError(ErrorCode::kInvalidArgument, "hold_out_every = 1 leaves nothing to compile");
  return Ok();
}

}  // namespace

OptionTable DescribeOptions(ReconstructOptions* o) {
  OptionTable table = {
      {.name = "mapper",
       .value = &o->mapper.mapper,
       .help = "global: poses of all images at once, by COLMAP if that joins too few; colmap: by COLMAP "
               "alone; auto: global, by COLMAP, too, where less than four fifths of images in no order are "
               "joined, unless all at once many more are",
       .choices = {"auto", "global", "colmap"}},
      {.name = "max_hours",
       .value = &o->mapper.max_hours,
       .help = "time limit of COLMAP's mapper, hours",
       .min = 1e-6},
      {.name = "refine_focal_length",
       .value = &o->mapper.refine_focal_length,
       .help = "refine the cameras' focal lengths"},
      {.name = "refine_distortion",
       .value = &o->mapper.refine_distortion,
       .help = "refine the cameras' distortion; cameras given without any get one radial parameter"},
      {.name = "deterministic",
       .value = &o->mapper.deterministic,
       .help = "COLMAP on one thread, and the same bytes on every run; false: all cores in its bundle "
               "adjustment"},
      {.name = "min_registered_ratio",
       .value = &o->min_registered_ratio,
       .help = "smallest part of the images that must be registered together",
       .min = 0,
       .max = 1},
      {.name = "scale_from",
       .value = &o->scale_from,
       .help =
           "where scale and axes come from; auto: the first that is there of control_points, the capture's "
           "odometry.txt, its imu.csv, GPS, rig_baselines, camera_height_m and distances, or one after it "
           "that "
           "knows the scale three times as well",
       .choices = {"auto", "control_points", "odometry", "imu", "gps", "rig", "camera_height", "distances",
                   "none"}},
      {.name = "control_points",
       .value = &o->control_points,
       .help =
           "file of known camera positions, IMAGE X Y Z a line, metres, z up; absolute or relative to the "
           "capture"},
      {.name = "distances",
       .value = &o->distances,
       .help = "file of known distances between cameras, IMAGE1 IMAGE2 METRES a line; absolute or relative "
               "to the capture"},
      {.name = "rig_baselines",
       .value = &o->rig_baselines,
       .help =
           "file of how far cameras of a rig are apart, FOLDER1 FOLDER2 METRES a line; their images of one "
           "name below the two folders were taken at once; absolute or relative to the capture"},
      {.name = "rig_sigma_ratio",
       .value = &o->rig_sigma_ratio,
       .help = "standard deviation of a stated baseline over its length",
       .min = 1e-6},
      {.name = "gps_sigma_m",
       .value = &o->gps_sigma_m,
       .help = "standard deviation of GPS positions per level axis, metres",
       .min = 1e-3},
      {.name = "gps_altitude_sigma_m",
       .value = &o->gps_altitude_sigma_m,
       .help = "standard deviation of GPS altitudes, metres",
       .min = 1e-3},
      {.name = "control_point_sigma_m",
       .value = &o->control_point_sigma_m,
       .help = "standard deviation of control points per axis, metres",
       .min = 1e-6},
      {.name = "distance_sigma_ratio",
       .value = &o->distance_sigma_ratio,
       .help = "standard deviation of a known distance over its length",
       .min = 1e-6},
      {.name = "odometry_sigma_ratio",
       .value = &o->odometry_sigma_ratio,
       .help = "standard deviation of what all of the odometry shares over its length: a wheel's radius",
       .min = 1e-6},
      {.name = "imu_sigma_ratio",
       .value = &o->imu_sigma_ratio,
       .help =
           "standard deviation of what all of an IMU shares over its length: the accelerometer's own scale",
       .min = 1e-6},
      {.name = "imu_accel_noise",
       .value = &o->imu_accel_noise,
       .help = "white noise of the IMU's accelerometer, as its data sheet has it, m/s^2/sqrt(Hz)",
       .min = 1e-6},
      {.name = "imu_gyro_noise",
       .value = &o->imu_gyro_noise,
       .help = "white noise of the IMU's gyro, as its data sheet has it, rad/s/sqrt(Hz)",
       .min = 1e-7},
      {.name = "camera_height_m",
       .value = &o->camera_height_m,
       .help = "how high the camera is over a flat floor, wherever it drives, metres; 0: not known",
       .min = 0},
      {.name = "camera_height_sigma_m",
       .value = &o->camera_height_sigma_m,
       .help = "standard deviation of camera_height_m, metres",
       .min = 1e-6},
      {.name = "up_sigma_deg",
       .value = &o->up_sigma_deg,
       .help = "standard deviation of the cameras' mean up against the vertical, degrees",
       .min = 1e-3,
       .max = 180},
      {.name = "unscaled_depth",
       .value = &o->unscaled_depth,
       .help =
           "without any scale: median distance of the points from images that see them, in the map's unit",
       .min = 1e-6},
      {.name = "hold_out_every",
       .value = &o->hold_out_every,
       .help = "one in this many registered images is kept out of the map, as a query; 0: none",
       .min = 0},
  };
  // What does not give the scale is compared with what does.
  AddCondition({"scale_from",
                {"auto", "control_points", "odometry", "imu", "gps", "rig", "camera_height", "distances"}},
               {"control_points", "control_point_sigma_m", "odometry_sigma_ratio", "imu_sigma_ratio",
                "gps_sigma_m", "gps_altitude_sigma_m", "rig_baselines", "rig_sigma_ratio", "camera_height_m",
                "camera_height_sigma_m", "distances", "distance_sigma_ratio"},
               &table);
  AddCondition({"scale_from", {"auto", "none"}}, {"unscaled_depth"}, &table);
  return table;
}

Result<ReconstructResult> Reconstruct(const MapperInput& input, const Capture& capture,
                                      const ReconstructOptions& options, const std::string& work_folder,
                                      int num_threads, Progress& progress) {
  CAIRN_RETURN_IF_ERROR(CheckReconstructOptions(options));
  ReconstructResult result;
  if (!capture.registered.empty()) {
    CAIRN_ASSIGN_OR_RETURN(ColmapModel joined,
                           RegisterToOthers(input, capture, options, num_threads, progress, &result));
    const std::vector<ColmapModel> models = {std::move(joined)};
    CountModels(models, &result);
    if (!models[0].images.empty()) result.verdict = JudgeModels(models, Similarity(), result);
    return result;
  }
  const Result<std::vector<ColmapModel>> mapped =
      MapImages(input, capture, options, work_folder, num_threads, progress, &result);
  std::string zoomed = ZoomedLens(input);
  if (zoomed.empty()) zoomed = ZoomedPart(input);
  if (!mapped.ok()) {
    if (mapped.error().code != ErrorCode::kNoData || zoomed.empty()) return mapped.error();
    return MakeError(ErrorCode::kNoData, "{}; {}", mapped.error().message, zoomed);
  }
  if (!zoomed.empty()) result.warnings.push_back(fmt::format("{}: {}", capture.root, zoomed));
  const std::vector<ColmapModel>& models = *mapped;
  const ColmapModel& model = models[0];
  result.frame.is_reconstructed = true;
  CountModels(models, &result);
  CollectRejects(input, models, &result);
  CAIRN_RETURN_IF_ERROR(CheckRegistered(input, models, options, &result));
  CAIRN_ASSIGN_OR_RETURN(const Similarity world_from_model, FindFrame(model, capture, options, &result));
  CollectImages(model, world_from_model, options.hold_out_every, &result);
  result.verdict = JudgeModels(models, world_from_model, result);
  return result;
}

}  // namespace cairn::reconstruct
