#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "ros/map_localizer.h"
#include "runtime/drive/image_servo.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Steers a robot from survey image to survey image (runtime/drive/image_servo.h), as `cairn drive` does.
class Steerer {
 public:
  // Errors: InvalidArgument (a speed, a time, a camera that looks farther aside than a servo can do with).
  static cairn::Result<Steerer> Make(std::shared_ptr<const cairn::Map> map, const Parameters& parameters,
                                     const cairn::Pose& robot_from_camera);

  // Features of an image, as Step takes them.  Errors: as ExtractSift.
  cairn::Result<cairn::Features> See(const cv::Mat& grey) const;
  // The command on the way to a survey image; images on the way to the goal are passed at wider tolerances.
  // Errors: as ImageServo::ToImage and StepFeatures.
  cairn::Result<cairn::ServoCommand> Step(int32_t image, bool is_goal, const cairn::Features& seen,
                                          const cairn::Camera& camera);
  // The next image begins a leg of its own.
  void Forget() { servo_.reset(); }

 private:
  explicit Steerer(std::shared_ptr<const cairn::Map> map) : map_(std::move(map)) {}

  std::shared_ptr<const cairn::Map> map_;
  cairn::ImageServoOptions options_;
  std::optional<cairn::ImageServo> servo_;
  int32_t image_ = -1;  // of the servo
  bool is_goal_ = false;
};

}  // namespace cairn_ros
