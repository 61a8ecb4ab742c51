#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// Where a robot stands on the floor: floor_from_robot, x ahead of it, y to its left.
struct PlanarPose {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // floor frame, metres
  double heading_rad = 0;                              // counter-clockwise from +x

  Eigen::Vector2d FloorFromRobot(const Eigen::Vector2d& point) const {
    return position + Eigen::Rotation2Dd(heading_rad) * point;
  }
  Eigen::Vector2d RobotFromFloor(const Eigen::Vector2d& point) const {
    return Eigen::Rotation2Dd(-heading_rad) * (point - position);
  }
};

// The same angle in [-pi, pi].
inline double WrapAngle(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

// floor_from_a times a_from_b.
inline PlanarPose operator*(const PlanarPose& a, const PlanarPose& b) {
  return {a.FloorFromRobot(b.position), WrapAngle(a.heading_rad + b.heading_rad)};
}
// How a robot moved from one pose to another, in its frame at the first: from * MotionBetween(from, to) = to.
inline PlanarPose MotionBetween(const PlanarPose& from, const PlanarPose& to) {
  return {from.RobotFromFloor(to.position), WrapAngle(to.heading_rad - from.heading_rad)};
}

}  // namespace cairn
