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

}  // namespace cairn
