#pragma once

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/geometry/planar_pose.h"

namespace cairn {

// Of a point's offset along a normal, by the pose: x, y, heading.  `arm`: from the robot to the point, floor
// frame.
inline Eigen::Vector3d OffsetRow(const Eigen::Vector2d& normal, const Eigen::Vector2d& arm) {
  return {normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-arm.y(), arm.x()))};
}

// Tukey's weight of an offset within a band; 0 at its border.
inline double TukeyWeight(double off, double band) {
  const double weight = 1 - off * off / (band * band);
  return weight * weight;
}

// One step of Gauss-Newton that brings weighted offsets of points from walls to zero.
class PoseStep {
 public:
  // `prior`: what nothing fixes stays.
  explicit PoseStep(double prior) : information_(prior * Eigen::Matrix3d::Identity()) {}

  // `row`: OffsetRow.
  void Add(double weight, double off, const Eigen::Vector3d& row) {
    information_ += weight * row * row.transpose();
    gradient_ -= weight * off * row;
  }
  // Moves a pose, by no more than `longest_m` and `largest_turn_rad`; returns by how much, metres and radians
  // together.
  double Move(double longest_m, double largest_turn_rad, PlanarPose* pose) const {
    Eigen::Vector3d change = information_.ldlt().solve(gradient_);
    change.head<2>() *= std::min(1.0, longest_m / std::max(longest_m, change.head<2>().norm()));
    change[2] = std::clamp(change[2], -largest_turn_rad, largest_turn_rad);
    pose->position += change.head<2>();
    pose->heading_rad = WrapAngle(pose->heading_rad + change[2]);
    return change.norm();
  }

 private:
  Eigen::Matrix3d information_;
  Eigen::Vector3d gradient_ = Eigen::Vector3d::Zero();
};

}  // namespace cairn
