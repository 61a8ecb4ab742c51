#include "ros/steerer.h"

#include <cmath>
#include <utility>

#include "core/features/sift.h"
#include "core/geometry/pose.h"
#include "ros/odometry.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

namespace {

// A camera that looks elsewhere than ahead would lead the robot beside its way.
constexpr double kMaxLookingAsideDeg = 10;

}  // namespace

Result<Steerer> Steerer::Make(std::shared_ptr<const Map> map, const Parameters& parameters,
                              const Pose& robot_from_camera) {
  Steerer steerer(std::move(map));
  ServoOptions& servo = steerer.options_.servo;
  servo.patience_commands = kDrivePatienceCommands;
  servo.step_s = parameters.step_s;
  servo.max_speed_m_s = parameters.max_speed_m_s;
  servo.max_turn_deg_s = parameters.max_turn_deg_s;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&steerer.options_)));
  if (!(parameters.stop_after_s > 0) || !std::isfinite(parameters.stop_after_s))
    return MakeError(ErrorCode::kInvalidArgument, "~stop_after_s is {}; must be positive",
                     parameters.stop_after_s);
  if (parameters.camera_in_robot.empty()) return steerer;
  const double aside_deg = DegFromRad(CameraOnFloor(robot_from_camera).heading_rad);
  if (std::abs(aside_deg) > kMaxLookingAsideDeg)
    return MakeError(ErrorCode::kInvalidArgument,
                     "~steer: by ~camera_in_robot the camera looks {:.0f} degrees to the {} of where the "
                     "robot drives; a robot is steered by one that looks ahead, within {:g} degrees",
                     std::abs(aside_deg), aside_deg > 0 ? "left" : "right", kMaxLookingAsideDeg);
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
