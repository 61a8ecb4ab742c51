#include "ros/odometry.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace cairn {
namespace {

// Odometry of 1000 Hz for 4 s: of an image that took longer on its way nothing is known.
constexpr size_t kMaxNumPoses = 4000;
// Odometry that has ended says no more that the robot stands.
constexpr double kMaxAgeS = 1;

PlanarPose Compose(const PlanarPose& a, const PlanarPose& b) {
  return {a.FloorFromRobot(b.position), WrapAngle(a.heading_rad + b.heading_rad)};
}

}  // namespace

Status Odometry::Add(double time_s, const PlanarPose& odom_from_robot) {
  if (!std::isfinite(time_s) || !odom_from_robot.position.allFinite() ||
      !std::isfinite(odom_from_robot.heading_rad))
    return MakeError(ErrorCode::kInvalidArgument, "odometry that is not finite");
  if (!poses_.empty() && time_s < poses_.back().time_s) {
    poses_.clear();
    last_.reset();
  }
  if (!poses_.empty() && time_s == poses_.back().time_s) poses_.pop_back();
  poses_.push_back({time_s, odom_from_robot});
  if (poses_.size() > kMaxNumPoses) poses_.pop_front();
  return Ok();
}

std::optional<PlanarPose> Odometry::At(double time_s) const {
  if (poses_.empty()) return std::nullopt;
  if (time_s > poses_.back().time_s + kMaxAgeS) return std::nullopt;
  if (time_s == 0 || time_s >= poses_.back().time_s) return poses_.back().odom_from_robot;
  const auto after = std::upper_bound(poses_.begin(), poses_.end(), time_s,
                                      [](double time, const TimedPose& pose) { return time < pose.time_s; });
  if (after == poses_.begin()) return std::nullopt;
  const TimedPose& a = *std::prev(after);
  const double share = (time_s - a.time_s) / (after->time_s - a.time_s);
  const PlanarPose& from = a.odom_from_robot;
  const PlanarPose& to = after->odom_from_robot;
  return PlanarPose{from.position + share * (to.position - from.position),
                    WrapAngle(from.heading_rad + share * WrapAngle(to.heading_rad - from.heading_rad))};
}

std::optional<FloorMotion> Odometry::MoveTo(double image_time_s) {
  const std::optional<PlanarPose> robot = At(image_time_s);
  if (!robot) {
    last_.reset();
    return std::nullopt;
  }
  const PlanarPose camera = Compose(*robot, robot_from_camera_);
  const std::optional<PlanarPose> before = std::exchange(last_, camera);
  if (!before) return std::nullopt;
  return FloorMotion{before->RobotFromFloor(camera.position),
                     WrapAngle(camera.heading_rad - before->heading_rad)};
}

}  // namespace cairn
