#include "runtime/drive/image_servo.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/quantiles.h"
#include "core/blocks/map_rows.h"
#include "core/features/descriptor_matcher.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

constexpr DescriptorMatcherOptions kPixelMatcher{.max_ratio = 0.85, .max_angle_rad = 0.8};

bool IsSameCamera(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.params == b.params;
}

// How far what a survey image shows is from it over the floor, on the median, in the map's unit.
Result<double> SceneDistance(const Map& map, int32_t image_idx) {
  CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(image_idx));
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(image->landmarks, false));
  std::vector<double> distances;
  for (const MapLandmark& landmark : landmarks->landmarks) {
    const Eigen::Vector3d point = image->cam_from_world * landmark.position;
    distances.push_back(std::hypot(point.x(), point.z()));
  }
  return Median(std::move(distances));
}

Status CheckImageServo(const ImageServoOptions& options) {
  ImageServoOptions checked = options;
  return CheckOptions(DescribeOptions(&checked));
}

Status CheckDescribed(size_t num_pixels, const DescriptorMatrix& descriptors, const DescriptorKind& kind) {
  if (descriptors.rows() > 0 && descriptors.cols() != kind.num_values) {
    return MakeError(ErrorCode::kInvalidArgument, "descriptors of {} values, expected {} of the kind '{}'",
                     descriptors.cols(), kind.num_values, ToString(kind));
  }
  if (static_cast<Eigen::Index>(num_pixels) == descriptors.rows()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "{} pixels with {} descriptors", num_pixels,
                   descriptors.rows());
}

}  // namespace

Result<ServoTarget> TargetOfImage(const Map& map, int32_t image_idx, const std::optional<Camera>& camera) {
  if (image_idx < 0 || image_idx >= map.num_images())
    return MakeError(ErrorCode::kInvalidArgument, "image {} of {}", image_idx, map.num_images());
  if (camera) CAIRN_RETURN_IF_ERROR(CheckCamera(*camera));
  CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(image_idx));
  CAIRN_ASSIGN_OR_RETURN(const auto landmarks, map.Gather(image->landmarks, false));
  const auto of_survey = std::find_if(map.head().cameras.begin(), map.head().cameras.end(),
                                      [&](const Camera& c) { return c.camera_id == image->camera_id; });
  ServoTarget target;
  std::vector<Eigen::Index> rows;
  for (size_t i = 0; i < landmarks->idx.size(); ++i) {
    const auto pixel = ImageFromCamera(camera ? *camera : *of_survey,
                                       image->cam_from_world * landmarks->landmarks[i].position);
    if (!pixel) continue;
    target.pixels.push_back(*pixel);
    rows.push_back(static_cast<Eigen::Index>(i));
  }
  target.kind = map.head().descriptor_kind;
  target.descriptors.resize(static_cast<Eigen::Index>(rows.size()), landmarks->descriptors.cols());
  for (size_t i = 0; i < rows.size(); ++i) target.descriptors.row(i) = landmarks->descriptors.row(rows[i]);
  return target;
}

ServoTarget TargetOfFeatures(const Features& features) {
  ServoTarget target{{}, features.descriptors, features.kind};
  for (const Keypoint& keypoint : features.keypoints) target.pixels.emplace_back(keypoint.x, keypoint.y);
  return target;
}

std::vector<PixelPair> MatchPixels(const Features& seen, const ServoTarget& target) {
  std::vector<PixelPair> pairs;
  if (seen.kind.space() != target.kind.space()) return pairs;
  for (const Match& match :
       MatchDescriptors(seen.descriptors, target.descriptors, target.kind.space(), kPixelMatcher)) {
    const Keypoint& keypoint = seen.keypoints[match.idx1];
    pairs.push_back({{keypoint.x, keypoint.y}, target.pixels[match.idx2]});
  }
  return pairs;
}

OptionTable DescribeOptions(PassOptions* o) {
  return {{"pass_distance_ratio", &o->pass_distance_ratio,
           "distance at which images on the way count as reached, over that of the scene", 1e-4, 1},
          {"pass_heading_deg", &o->pass_heading_deg,
           "turn at which images on the way count as reached, degrees", 1e-3, 45}};
}

ServoOptions PassingServo(ServoOptions options, const PassOptions& pass) {
  options.arrive_distance_ratio = pass.pass_distance_ratio;
  options.arrive_heading_deg = pass.pass_heading_deg;
  return options;
}

OptionTable DescribeOptions(ImageServoOptions* options) {
  OptionTable all = DescribeOptions(&options->servo);
  for (const OptionTable& part :
       {DescribeOptions(&options->servo.epipoles), DescribeOptions(&options->sift)}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

int NumAgreeing(const Features& seen, const ServoTarget& target, const Camera& camera,
                const ServoOptions& options) {
  Result<Servo> servo = Servo::Create(camera, options);
  if (!servo.ok()) return 0;
  const ServoCommand command = servo->Step(MatchPixels(seen, target));
  return command.epipoles ? command.epipoles->num_inliers : 0;
}

Result<ImageServo> ImageServo::ToImage(std::shared_ptr<const Map> map, int32_t image,
                                       const ImageServoOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckImageServo(options));
  CAIRN_ASSIGN_OR_RETURN(const ServoTarget target, TargetOfImage(*map, image));
  if (target.pixels.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const std::string name, map->ImageName(image));
    return MakeError(ErrorCode::kNoData,
                     "image {} shows none of the map's landmarks, so that no robot can be steered to it; "
                     "compile with [emit_map] landmarks = \"all\"",
                     name);
  }
  ImageServo servo(options);
  if (IsMetric(map->head().frame)) {
    // It need not be learnt from how the robot moves.
    double& known_m = servo.options_.servo.scene_distance_m;
    CAIRN_ASSIGN_OR_RETURN(known_m, SceneDistance(*map, image));
    known_m = std::clamp(known_m, 0.01, 1000.0);
  }
  servo.map_ = std::move(map);
  servo.image_ = image;
  return servo;
}

Result<ImageServo> ImageServo::ToTarget(ServoTarget target, const Camera& camera,
                                        const ImageServoOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckImageServo(options));
  CAIRN_RETURN_IF_ERROR(CheckDescribed(target.pixels.size(), target.descriptors, target.kind));
  ImageServo servo(options);
  servo.target_ = std::move(target);
  CAIRN_RETURN_IF_ERROR(servo.BeginWith(camera));
  return servo;
}

Status ImageServo::BeginWith(const Camera& camera) {
  const Result<Servo> servo = Servo::Create(camera, options_.servo);
  if (!servo.ok()) return servo.error();
  if (map_) {
    CAIRN_ASSIGN_OR_RETURN(target_, TargetOfImage(*map_, image_, camera));
  }
  camera_ = camera;
  servo_.emplace(*servo);
  return Ok();
}

Result<ServoCommand> ImageServo::Step(const cv::Mat& grey, const Camera& camera) {
  if (grey.cols != camera.width || grey.rows != camera.height)
    return MakeError(ErrorCode::kInvalidArgument, "an image of {} x {} px of a camera of {} x {} px",
                     grey.cols, grey.rows, camera.width, camera.height);
  CAIRN_ASSIGN_OR_RETURN(const Features seen, ExtractSift(grey, options_.sift));
  return StepFeatures(seen, camera);
}

Result<ServoCommand> ImageServo::StepFeatures(const Features& seen, const Camera& camera) {
  CAIRN_RETURN_IF_ERROR(CheckDescribed(seen.keypoints.size(), seen.descriptors, seen.kind));
  if (!servo_) {
    CAIRN_RETURN_IF_ERROR(BeginWith(camera));
  } else if (!IsSameCamera(camera, camera_)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "an image of another camera than before ({} of {} x {} px after {} of {} x {} px); a "
                     "servo is for one camera",
                     CameraModelName(camera.model), camera.width, camera.height,
                     CameraModelName(camera_.model), camera_.width, camera_.height);
  }
  CAIRN_RETURN_IF_ERROR(CheckSameKind(seen.kind, target_.kind, "the image"));
  return servo_->Step(MatchPixels(seen, target_));
}

}  // namespace cairn
