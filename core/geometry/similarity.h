#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/geometry/pose.h"

namespace cairn {

// b_from_a: point_in_b = scale * rotation * point_in_a + translation.
struct Similarity {
  double scale = 1;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return scale * (rotation * point) + translation;
  }
};

// The cam_from_b of the camera that is at cam_from_a.
inline Pose TransformPose(const Similarity& b_from_a, const Pose& cam_from_a) {
  const Eigen::Quaterniond rotation = (cam_from_a.rotation * b_from_a.rotation.conjugate()).normalized();
  return {rotation, -(rotation * (b_from_a * cam_from_a.Center()))};
}

}  // namespace cairn
