#include "stages/reconstruct/scale_sources.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stages/reconstruct/align.h"
#include "stages/reconstruct/floor_plane.h"
#include "stages/reconstruct/known_places.h"
#include "stages/reconstruct/odometry.h"

namespace cairn::reconstruct {
namespace {

constexpr double kNoAltitudeSigmaM = 1e5;  // of an altitude that is not known
constexpr double kMaxResidualSigmas = 3;
// A camera that is so much higher or lower over the floor, as a part of its height, is off.
constexpr double kMaxHeightErrorRatio = 0.15;
// Pairs of a rig in a row that err together.
constexpr double kNumNeighbours = 10;
// Odometry whose pieces spread more is worth a warning.
constexpr double kMaxOdometrySpread = 0.1;
// So is odometry by which the cameras' mean up is farther from the vertical than this: a camera that looks at
// the ceiling is at 90.
constexpr double kMaxTiltDeg = 120;
// An IMU that knows the scale less well than this was hardly accelerated: then its errors are no longer
// normal.
constexpr double kMaxImuSigmaRatio = 0.2;

std::string InputPath(const Capture& capture, const std::string& path) {
  return (std::filesystem::path(capture.root) / path).lexically_normal().string();
}

std::string OdometryPath(const Capture& capture) { return capture.root + "/" + kOdometryFile; }

// From the images' known positions.
Result<ScaleAnswer> AlignImages(const ScaleQuestion& question,
                                const std::map<std::string, PositionTarget>& known) {
  std::vector<std::string> names;
  std::vector<PositionTarget> targets;
  for (const auto& [name, target] : known) {
    const auto pose = question.model.find(name);
    if (pose == question.model.end()) continue;
    names.push_back(name);
    targets.push_back(target);
    targets.back().model = pose->second.Center();
  }
  const Vertical vertical = VerticalOf(question);
  CAIRN_ASSIGN_OR_RETURN(const Alignment alignment,
                         AlignToPositions(targets, vertical.up, vertical.sigma_deg));
  ScaleAnswer answer{.world_from_model = alignment.world_from_model,
                     .sigma_ratio = alignment.scale_sigma_ratio,
                     .centre = alignment.centre};
  for (size_t i = 0; i < names.size(); ++i)
    answer.residuals.push_back({names[i], alignment.residuals_m[i], alignment.is_off[i]});
  return answer;
}

Result<ScaleAnswer> AskGps(const ScaleQuestion& question) {
  const std::map<std::string, ExifTags> tags = ReadGpsTags(question.capture);
  if (tags.empty()) {
    return MakeError(ErrorCode::kNoData, "{}: no image has a GPS position in its EXIF block",
                     question.capture.root);
  }
  const ReconstructOptions& options = question.options;
  const GeodeticPosition anchor = MedianPosition(tags);
  std::map<std::string, PositionTarget> known;
  for (const auto& [name, exif] : tags) {
    const double altitude_sigma_m = exif.has_altitude ? options.gps_altitude_sigma_m : kNoAltitudeSigmaM;
    GeodeticPosition position = *exif.gps;
    if (!exif.has_altitude) position.altitude_m = anchor.altitude_m;
    known[name] = {.world = EnuFromGeodetic(anchor, position),
                   .sigma_m = {options.gps_sigma_m, options.gps_sigma_m, altitude_sigma_m}};
  }
  Result<ScaleAnswer> answer = AlignImages(question, known);
  if (!answer.ok()) {
    return MakeError(answer.error().code, "{}: GPS in EXIF: {}", question.capture.root,
                     answer.error().message);
  }
  answer->told_by = fmt::format("the GPS of {} images", answer->residuals.size());
  answer->anchor = anchor;
  return answer;
}

Result<ScaleAnswer> AskControlPoints(const ScaleQuestion& question) {
  const std::string path = InputPath(question.capture, question.options.control_points);
  CAIRN_ASSIGN_OR_RETURN(const auto points, ReadControlPoints(path, question.capture));
  std::map<std::string, PositionTarget> known;
  std::vector<std::string> warnings;
  for (const auto& [name, point] : points) {
    known[name] = {.world = point,
                   .sigma_m = Eigen::Vector3d::Constant(question.options.control_point_sigma_m)};
    if (question.model.count(name) == 0)
      warnings.push_back(fmt::format("{}: image {} was not registered", path, name));
  }
  Result<ScaleAnswer> answer = AlignImages(question, known);
  if (!answer.ok()) {
    return MakeError(answer.error().code, "{}: of the registered images: {}", path, answer.error().message);
  }
  answer->told_by = path;
  answer->warnings = std::move(warnings);
  return answer;
}

// From known distances of images, each off by more than three times sigma_ratio if it contradicts the scale
// found.
Result<ScaleAnswer> ScaleByDistances(const ScaleQuestion& question, const std::string& path,
                                     const std::vector<KnownDistance>& distances, double sigma_ratio) {
  ScaleAnswer answer{.told_by = path};
  std::vector<DistanceTarget> targets;
  std::vector<std::string> names;
  for (const KnownDistance& known : distances) {
    const auto pose1 = question.model.find(known.name1), pose2 = question.model.find(known.name2);
    if (pose1 == question.model.end() || pose2 == question.model.end()) {
      answer.warnings.push_back(fmt::format("{}: image {} was not registered", path,
                                            pose1 == question.model.end() ? known.name1 : known.name2));
      continue;
    }
    targets.push_back({CenterErrorM(pose1->second, pose2->second), known.distance_m});
    names.push_back(known.name1 + " " + known.name2);
  }
  const Result<DistanceScale> found = ScaleFromDistances(targets, sigma_ratio);
  if (!found.ok()) return MakeError(found.error().code, "{}: {}", path, found.error().message);
  for (size_t i = 0; i < targets.size(); ++i) {
    const double residual_m = std::abs(found->scale * targets[i].model - targets[i].world_m);
    const bool is_off = residual_m > kMaxResidualSigmas * sigma_ratio * targets[i].world_m;
    answer.residuals.push_back({names[i], residual_m, is_off});
  }
  answer.world_from_model = LevelledFrame(PosesOf(question.model), found->scale, VerticalOf(question).up);
  answer.sigma_ratio = found->sigma_ratio;
  return answer;
}

Result<ScaleAnswer> AskDistances(const ScaleQuestion& question) {
  const std::string path = InputPath(question.capture, question.options.distances);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<KnownDistance> distances,
                         ReadKnownDistances(path, question.capture));
  return ScaleByDistances(question, path, distances, question.options.distance_sigma_ratio);
}

// The error of a stated baseline is the same in all pairs, and so are errors of the places of images that
// follow each other.
Result<ScaleAnswer> AskRig(const ScaleQuestion& question) {
  const std::string path = InputPath(question.capture, question.options.rig_baselines);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<KnownDistance> pairs, ReadRigBaselines(path, question.capture));
  const double stated_ratio = question.options.rig_sigma_ratio;
  CAIRN_ASSIGN_OR_RETURN(ScaleAnswer answer, ScaleByDistances(question, path, pairs, stated_ratio));
  const auto num_pairs = static_cast<double>(answer.residuals.size());
  answer.told_by = fmt::format("{} of {} pairs of images", path, num_pairs);
  answer.sigma_ratio =
      std::hypot(stated_ratio, answer.sigma_ratio * std::sqrt(std::min(num_pairs, kNumNeighbours)));
  // Images that are missing are listed as rejects already.
  answer.warnings.clear();
  return answer;
}

Result<ScaleAnswer> AskOdometry(const ScaleQuestion& question) {
  const std::string path = OdometryPath(question.capture);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<OdometryPose> odometry, ReadOdometry(path, question.capture));
  const Result<OdometryAlignment> alignment = AlignToOdometry(odometry, question.model);
  if (!alignment.ok()) return MakeError(alignment.error().code, "{}: {}", path, alignment.error().message);
  ScaleAnswer answer{
      .told_by = path,
      .world_from_model = alignment->world_from_model,
      .sigma_ratio = std::hypot(alignment->scale_sigma_ratio, question.options.odometry_sigma_ratio),
      .centre = alignment->first};
  size_t num_off = 0;
  const Eigen::Vector3d up = alignment->world_from_model.rotation * MeanUp(PosesOf(question.model));
  if (const double tilt_deg = DegFromRad(std::acos(std::clamp(up.normalized().z(), -1.0, 1.0)));
      tilt_deg > kMaxTiltDeg) {
    answer.warnings.push_back(fmt::format(
        "{}: by it the cameras stand upside down ({:.0f} degrees), and so does the map: its z points "
        "down; write world from camera with z up, unless the camera hangs so",
        path, tilt_deg));
  }
  for (const OdometryWindow& window : alignment->windows) {
    const double found_m = answer.world_from_model.scale * window.model;
    answer.residuals.push_back(
        {window.first + " " + window.last, std::abs(found_m - window.odometry_m), window.is_off});
    num_off += window.is_off ? 1 : 0;
  }
  if (alignment->spread_ratio > kMaxOdometrySpread || 4 * num_off > alignment->windows.size()) {
    answer.warnings.push_back(
        fmt::format("{}: on pieces of the way the odometry and the images disagree by {:.0f} %, on {} "
                    "of {} by far more: wheels that slip, another unit, or images in the wrong places; the "
                    "scale is as doubtful",
                    path, 100 * alignment->spread_ratio, num_off, alignment->windows.size()));
  }
  return answer;
}

Result<ScaleAnswer> AskImu(const ScaleQuestion& question) {
  if (!question.imu) {
    return MakeError(ErrorCode::kNotFound,
                     "{}/{}: not found: what an IMU says, TIME_NS,WX,WY,WZ,AX,AY,AZ a line, belongs there",
                     question.capture.root, kImuFile);
  }
  if (!question.imu->ok()) return question.imu->error();
  const InertialScale& imu = **question.imu;
  if (!(imu.sigma_ratio <= kMaxImuSigmaRatio)) {
    return MakeError(
        ErrorCode::kNoData,
        "{}: the motion does not show the scale{}: only a camera that speeds up, brakes, or swings to "
        "the sides shows it, in images that follow each other closely (keyframes = 0.2 of a bag or film); "
        "what it says of up is taken",
        imu.told_by,
        std::isfinite(imu.sigma_ratio) ? fmt::format(" to better than {:.0f} %", 100 * imu.sigma_ratio) : "");
  }
  ScaleAnswer answer{.told_by = imu.told_by,
                     .world_from_model = LevelledFrame(PosesOf(question.model), imu.scale, imu.up),
                     .sigma_ratio = std::hypot(imu.sigma_ratio, question.options.imu_sigma_ratio),
                     .warnings = imu.warnings};
  for (const InertialResidual& residual : imu.residuals)
    answer.residuals.push_back({residual.name, residual.residual_m, residual.is_off});
  return answer;
}

Result<ScaleAnswer> AskCameraHeight(const ScaleQuestion& question) {
  const double height_m = question.options.camera_height_m;
  std::map<ImageId, int> camera_of_image;
  std::vector<Eigen::Vector3d> centers;
  for (const ModelImage& image : question.reconstruction.images) {
    camera_of_image.emplace(image.image_id, static_cast<int>(centers.size()));
    centers.push_back(image.cam_from_world.Center());
  }
  std::vector<SeenPoint> points;
  for (const ModelPoint& point : question.reconstruction.points) {
    points.push_back({.position = point.position, .cameras = {}});
    for (const auto& [image_id, keypoint] : point.track)
      points.back().cameras.push_back(camera_of_image.at(image_id));
  }
  const std::vector<Pose> poses = PosesOf(question.model);
  const Result<FloorPlane> floor = FindFloor(points, centers, VerticalOf(question).up);
  if (!floor.ok()) {
    return MakeError(
        floor.error().code,
        "{}: camera_height_m = {:g}: no floor is found that the camera is over: {}; take it out of "
        "the recipe, or give odometry.txt or distances",
        question.capture.root, height_m, floor.error().message);
  }
  const double scale = height_m / floor->height;
  ScaleAnswer answer{
      .told_by = fmt::format("the camera's height over {} points of the floor", floor->num_points),
      .world_from_model = LevelledFrame(poses, scale, floor->up),
      .sigma_ratio = std::hypot(floor->sigma_ratio, question.options.camera_height_sigma_m / height_m)};
  for (size_t i = 0; i < floor->cameras.size(); ++i) {
    const double residual_m = std::abs(scale * floor->heights[i] - height_m);
    answer.residuals.push_back({question.reconstruction.images[floor->cameras[i]].name, residual_m,
                                residual_m > kMaxHeightErrorRatio * height_m});
  }
  return answer;
}

}  // namespace

std::vector<Pose> PosesOf(const ModelPoses& model) {
  std::vector<Pose> poses;
  for (const auto& [name, pose] : model) poses.push_back(pose);
  return poses;
}

Vertical VerticalOf(const ScaleQuestion& question) {
  if (question.imu && question.imu->ok()) return {(*question.imu)->up, (*question.imu)->up_sigma_deg};
  return {MeanUp(PosesOf(question.model)), question.options.up_sigma_deg};
}

std::optional<Result<InertialScale>> AskImuOnce(const Capture& capture, const ModelPoses& model,
                                                const ReconstructOptions& options) {
  if (!HasImu(capture)) return std::nullopt;
  return ScaleByImu(
      capture, model,
      {.noise = {.gyro_rad_s_rthz = options.imu_gyro_noise, .accel_m_s2_rthz = options.imu_accel_noise}});
}

const std::vector<ScaleSource>& ScaleSources() {
  static const std::vector<ScaleSource> sources = {
      {"control_points", [](const ScaleQuestion& q) { return !q.options.control_points.empty(); }, true,
       AskControlPoints},
      {"odometry", [](const ScaleQuestion& q) { return std::filesystem::exists(OdometryPath(q.capture)); },
       false, AskOdometry},
      {"imu", [](const ScaleQuestion& q) { return q.imu.has_value(); }, false, AskImu},
      {"gps", [](const ScaleQuestion&) { return true; }, false, AskGps},
      {"rig", [](const ScaleQuestion& q) { return !q.options.rig_baselines.empty(); }, true, AskRig},
      {"camera_height", [](const ScaleQuestion& q) { return q.options.camera_height_m > 0; }, true,
       AskCameraHeight},
      {"distances", [](const ScaleQuestion& q) { return !q.options.distances.empty(); }, true, AskDistances},
  };
  return sources;
}

}  // namespace cairn::reconstruct
