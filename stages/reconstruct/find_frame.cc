#include "stages/reconstruct/find_frame.h"

#include <cmath>
#include <filesystem>

#include "stages/reconstruct/align.h"
#include "stages/reconstruct/known_places.h"
#include "stages/reconstruct/odometry.h"

namespace cairn::reconstruct {
namespace {

constexpr double kNoAltitudeSigmaM = 1e5;  // of an altitude that is not known
constexpr double kMaxResidualSigmas = 3;
// Odometry whose pieces spread more, and a scale by GPS that is this far off (logarithm), are worth a
// warning.
constexpr double kMaxOdometrySpread = 0.1, kMaxScaleDisagreement = 0.1;

std::vector<Pose> PosesOf(const ModelPoses& model) {
  std::vector<Pose> poses;
  for (const auto& [name, pose] : model) poses.push_back(pose);
  return poses;
}

std::string InputPath(const Capture& capture, const std::string& path) {
  return (std::filesystem::path(capture.root) / path).lexically_normal().string();
}

// Aligns to the images' known positions; appends to the residuals.
Result<Similarity> AlignImages(const ModelPoses& model, const std::map<std::string, PositionTarget>& known,
                               const ReconstructOptions& options, ReconstructResult* result) {
  std::vector<std::string> names;
  std::vector<PositionTarget> targets;
  for (const auto& [name, target] : known) {
    const auto pose = model.find(name);
    if (pose == model.end()) continue;
    names.push_back(name);
    targets.push_back(target);
    targets.back().model = pose->second.Center();
  }
  CAIRN_ASSIGN_OR_RETURN(const Alignment alignment,
                         AlignToPositions(targets, MeanUp(PosesOf(model)), options.up_sigma_deg));
  for (size_t i = 0; i < names.size(); ++i)
    result->residuals.push_back({names[i], alignment.residuals_m[i], alignment.is_off[i]});
  return alignment.world_from_model;
}

Result<Similarity> AlignToGps(const ModelPoses& model, const Capture& capture,
                              const ReconstructOptions& options, ReconstructResult* result) {
  const std::map<std::string, ExifTags> tags = ReadGpsTags(capture);
  if (tags.empty()) return MakeError(ErrorCode::kNoData, "no image has a GPS position in its EXIF block");
  const GeodeticPosition anchor = MedianPosition(tags);
  std::map<std::string, PositionTarget> known;
  for (const auto& [name, exif] : tags) {
    const double altitude_sigma_m = exif.has_altitude ? options.gps_altitude_sigma_m : kNoAltitudeSigmaM;
    GeodeticPosition position = *exif.gps;
    if (!exif.has_altitude) position.altitude_m = anchor.altitude_m;
    known[name] = {.world = EnuFromGeodetic(anchor, position),
                   .sigma_m = {options.gps_sigma_m, options.gps_sigma_m, altitude_sigma_m}};
  }
  CAIRN_ASSIGN_OR_RETURN(const Similarity similarity, AlignImages(model, known, options, result));
  result->frame.source = "gps";
  result->frame.anchor = anchor;
  return similarity;
}

Result<Similarity> AlignToControlPoints(const ModelPoses& model, const Capture& capture,
                                        const ReconstructOptions& options, ReconstructResult* result) {
  const std::string path = InputPath(capture, options.control_points);
  CAIRN_ASSIGN_OR_RETURN(const auto points, ReadControlPoints(path, capture));
  std::map<std::string, PositionTarget> known;
  for (const auto& [name, point] : points) {
    known[name] = {.world = point, .sigma_m = Eigen::Vector3d::Constant(options.control_point_sigma_m)};
    if (model.count(name) == 0)
      result->warnings.push_back(fmt::format("{}: image {} was not registered", path, name));
  }
  result->frame.source = "control_points";
  Result<Similarity> similarity = AlignImages(model, known, options, result);
  if (similarity.ok()) return similarity;
  return MakeError(similarity.error().code, "{}: of the registered images: {}", path,
                   similarity.error().message);
}

Result<Similarity> ScaleByDistances(const ModelPoses& model, const Capture& capture,
                                    const ReconstructOptions& options, ReconstructResult* result) {
  const std::string path = InputPath(capture, options.distances);
  CAIRN_ASSIGN_OR_RETURN(const std::vector<KnownDistance> distances, ReadKnownDistances(path, capture));
  std::vector<DistanceTarget> targets;
  std::vector<std::string> names;
  for (const KnownDistance& known : distances) {
    const auto pose1 = model.find(known.name1), pose2 = model.find(known.name2);
    if (pose1 == model.end() || pose2 == model.end()) {
      result->warnings.push_back(fmt::format("{}: image {} was not registered", path,
                                             pose1 == model.end() ? known.name1 : known.name2));
      continue;
    }
    targets.push_back({CenterErrorM(pose1->second, pose2->second), known.distance_m});
    names.push_back(known.name1 + " " + known.name2);
  }
  const Result<double> scale = ScaleFromDistances(targets);
  if (!scale.ok()) return MakeError(scale.error().code, "{}: {}", path, scale.error().message);
  for (size_t i = 0; i < targets.size(); ++i) {
    const double residual_m = std::abs(*scale * targets[i].model - targets[i].world_m);
    const double sigma_m = options.distance_sigma_ratio * targets[i].world_m;
    result->residuals.push_back({names[i], residual_m, residual_m > kMaxResidualSigmas * sigma_m});
  }
  result->frame.source = "distances";
  return LevelledFrame(PosesOf(model), *scale);
}

Result<Similarity> AlignByOdometry(const ModelPoses& model, const Capture& capture,
                                   ReconstructResult* result) {
  const std::string path = capture.root + "/" + kOdometryFile;
  CAIRN_ASSIGN_OR_RETURN(const std::vector<OdometryPose> odometry, ReadOdometry(path, capture));
  const Result<OdometryAlignment> alignment = AlignToOdometry(odometry, model);
  if (!alignment.ok()) return MakeError(alignment.error().code, "{}: {}", path, alignment.error().message);
  const double scale = alignment->world_from_model.scale;
  size_t num_off = 0;
  for (const OdometryWindow& window : alignment->windows) {
    result->residuals.push_back({window.first + " " + window.last,
                                 std::abs(scale * window.model - window.odometry_m), window.is_off});
    num_off += window.is_off ? 1 : 0;
  }
  if (alignment->spread_ratio > kMaxOdometrySpread || 4 * num_off > alignment->windows.size()) {
    result->warnings.push_back(
        fmt::format("{}: on pieces of the way the odometry and the images disagree by {:.0f} %, on {} "
                    "of {} by far more: wheels that slip, another unit, or images in the wrong places; the "
                    "scale is as doubtful",
                    path, 100 * alignment->spread_ratio, num_off, alignment->windows.size()));
  }
  result->frame.source = "odometry";
  result->scale_sigma_ratio = alignment->scale_sigma_ratio;
  return alignment->world_from_model;
}

// Whether GPS, where images have it, says another scale than the one found.
void CompareWithGps(const ModelPoses& model, const Capture& capture, const ReconstructOptions& options,
                    double scale, ReconstructResult* result) {
  ReconstructResult by_gps;
  const Result<Similarity> similarity = AlignToGps(model, capture, options, &by_gps);
  if (!similarity.ok()) return;
  const double ratio = similarity->scale / scale;
  if (std::abs(std::log(ratio)) < kMaxScaleDisagreement) {
    result->warnings.push_back(
        fmt::format("{}: the images' GPS agrees with the odometry's scale to {:.1f} %; scale_from = \"gps\" "
                    "makes the map's "
                    "frame east, north, up",
                    capture.root, 100 * std::abs(ratio - 1)));
    return;
  }
  result->warnings.push_back(
      fmt::format("{}: by the images' GPS everything is {:.2f} times as large as by the odometry, which is "
                  "taken; scale_from = \"gps\" takes the other",
                  capture.root, ratio));
}

Similarity WithoutScale(const ModelPoses& model, const ReconstructOptions& options,
                        ReconstructResult* result) {
  result->frame.unit = "arbitrary";
  result->frame.source = "none";
  const std::vector<Pose> poses = PosesOf(model);
  const double step = MedianStep(poses);
  return LevelledFrame(poses, step > 0 ? options.unscaled_step / step : 1);
}

}  // namespace

Result<Similarity> FindFrame(const ModelPoses& model, const Capture& capture,
                             const ReconstructOptions& options, ReconstructResult* result) {
  const std::string& from = options.scale_from;
  if (from == "control_points" || (from == "auto" && !options.control_points.empty()))
    return AlignToControlPoints(model, capture, options, result);
  if (from == "distances" || (from == "auto" && !options.distances.empty()))
    return ScaleByDistances(model, capture, options, result);
  if (from == "none") return WithoutScale(model, options, result);
  const bool has_odometry = std::filesystem::exists(capture.root + "/" + kOdometryFile);
  if (from == "odometry" || (from == "auto" && has_odometry)) {
    const Result<Similarity> by_odometry = AlignByOdometry(model, capture, result);
    if (by_odometry.ok()) {
      CompareWithGps(model, capture, options, by_odometry->scale, result);
      return by_odometry;
    }
    // What cannot be read is an error; what says nothing leaves the question to others.
    if (from == "odometry") {
      return MakeError(by_odometry.error().code, "scale_from = odometry: {}", by_odometry.error().message);
    }
    if (by_odometry.error().code != ErrorCode::kNoData) return by_odometry;
    result->warnings.push_back(by_odometry.error().message);
  }
  Result<Similarity> similarity = AlignToGps(model, capture, options, result);
  if (similarity.ok()) return similarity;
  if (from == "gps") {
    return MakeError(similarity.error().code, "{}: scale_from = gps: {}", capture.root,
                     similarity.error().message);
  }
  result->warnings.push_back(fmt::format(
      "{}: nothing gives a scale ({}): the map's unit is arbitrary; give odometry.txt, control_points or "
      "distances for metres",
      capture.root, similarity.error().message));
  return WithoutScale(model, options, result);
}

}  // namespace cairn::reconstruct
