#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/features/sift.h"
#include "core/options/options.h"
#include "runtime/drive/servo.h"

namespace cairn {

class Map;  // runtime/map/map.h

// What of an image can be found again: where it is in the image, and how it looks.
struct ServoTarget {
  std::vector<Eigen::Vector2d> pixels;  // COLMAP's convention
  DescriptorMatrix descriptors;         // row i: pixel i
  DescriptorKind kind;
};

// Of a survey image: the landmarks that it sees, where a camera at its pose has them; without a camera, the
// survey's own.  Errors: InvalidArgument (no such image), Corrupt, Io.
Result<ServoTarget> TargetOfImage(const Map& map, int32_t image,
                                  const std::optional<Camera>& camera = std::nullopt);
// Of an image of the robot's own, to which it wants to go back.
ServoTarget TargetOfFeatures(const Features& features);

// Descriptors that are each other's best, by the ratio test.
std::vector<PixelPair> MatchPixels(const Features& seen, const ServoTarget& target);

// How close a robot comes to images on its way, at which it does not stop; the servo's own tolerances hold at
// the goal.
struct PassOptions {
  // Passed: at this distance, over that of the scene, and this turn, degrees.  REQUIRES: > 0
  double pass_distance_ratio = 0.04;
  double pass_heading_deg = 4;
};
OptionTable DescribeOptions(PassOptions* options);
// ServoOptions::patience_commands of a robot on its way, which should not spend long on any image: it is less
// exact than a servo is by default.
inline constexpr int kDrivePatienceCommands = 40;
// The servo's options for an image on the way.
ServoOptions PassingServo(ServoOptions options, const PassOptions& pass);

struct ImageServoOptions {
  ServoOptions servo;
  // Of what the robot sees.  Fewer features than a fix needs do: one image is matched, and soon.
  SiftOptions sift{.max_num_features = 800};
};
// All that an ImageServo reads: of the servo, its epipoles, and features.
OptionTable DescribeOptions(ImageServoOptions* options);

// Matches of such features with a target that agree on one motion over the floor; 0 where none do: whether a
// robot sees what the target shows.
int NumAgreeing(const Features& seen, const ServoTarget& target, const Camera& camera,
                const ServoOptions& options);

// The servo with its eyes: steers a robot to where an image was taken by the pixels of its camera, which
// looks ahead; where it is on the robot is among the servo's options.  One for each target.  Deterministic.
class ImageServo {
 public:
  // To where a survey image was taken; the camera is that of the first step.  A map in metres says how far
  // the scene is, so that servo.scene_distance_m is not read.  Errors: InvalidArgument (no
  // such image, an option), NoData (an image that shows no landmarks), Corrupt, Io.
  static Result<ImageServo> ToImage(std::shared_ptr<const Map> map, int32_t image,
                                    const ImageServoOptions& options = {});
  // To any target of the robot's camera.  Errors: InvalidArgument (camera, an option, another number of
  // descriptors than of pixels).
  static Result<ImageServo> ToTarget(ServoTarget target, const Camera& camera,
                                     const ImageServoOptions& options = {});

  // The command after an image, 8-bit grey.  It holds for servo.step_s; a robot to which no other one came by
  // then stops.  kLost where the target is not in sight: the next image may show it again.  Errors:
  // InvalidArgument (an image that is not the camera's, another camera than in the step before, an image that
  // is not 8-bit grey), Corrupt, Io.  After an error the servo is as before.
  Result<ServoCommand> Step(const cv::Mat& grey, const Camera& camera);
  // The same of features that the caller has, in pixels of the camera.  Errors: those of the camera;
  // InvalidArgument (another number of descriptors than of keypoints).
  Result<ServoCommand> StepFeatures(const Features& seen, const Camera& camera);

  // Tells it that the last command did not move the robot: something stands in the way.
  void Blocked() {
    if (servo_) servo_->Blocked();
  }

 private:
  explicit ImageServo(const ImageServoOptions& options) : options_(options) {}
  Status BeginWith(const Camera& camera);

  ImageServoOptions options_;
  std::shared_ptr<const Map> map_;  // of the survey image; null: the target was given
  int32_t image_ = -1;
  // From the first step on.
  Camera camera_;
  ServoTarget target_;
  std::optional<Servo> servo_;
};

}  // namespace cairn
