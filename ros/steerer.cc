#include "ros/steerer.h"

#include <cmath>
#include <utility>

#include "core/features/sift.h"
#include "core/geometry/pose.h"
#include "ros/odometry.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

Result<Steerer> Steerer::Make(std::shared_ptr<const Map> map, const Parameters& parameters,
                              const Pose& robot_from_camera) {
  Steerer steerer(std::move(map));
  ServoOptions& servo = steerer.options_.servo;
  servo.patience_commands = kDrivePatienceCommands;
  servo.step_s = parameters.step_s;
  servo.max_speed_m_s = parameters.max_speed_m_s;
  servo.max_turn_deg_s = parameters.max_turn_deg_s;
  const PlanarPose camera = CameraOnFloor(robot_from_camera);
  servo.camera_ahead_m = camera.position.x();
  servo.camera_left_m = camera.position.y();
  servo.camera_turn_deg = DegFromRad(camera.heading_rad);
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&steerer.options_)));
  if (!(parameters.stop_after_s > 0) || !std::isfinite(parameters.stop_after_s))
    return MakeError(ErrorCode::kInvalidArgument, "~stop_after_s is {}; must be positive",
                     parameters.stop_after_s);
  return steerer;
}

Result<Features> Steerer::See(const cv::Mat& grey) const { return ExtractSift(grey, options_.sift); }

Result<ServoCommand> Steerer::Step(int32_t image, bool is_goal, const Features& seen, const Camera& camera) {
  if (!servo_ || image != image_ || is_goal != is_goal_) {
    ImageServoOptions options = options_;
    if (!is_goal) options.servo = PassingServo(options.servo, {});
    CAIRN_ASSIGN_OR_RETURN(servo_, ImageServo::ToImage(map_, image, options));
    image_ = image;
    is_goal_ = is_goal;
  }
  return servo_->StepFeatures(seen, camera);
}

}  // namespace cairn_ros
