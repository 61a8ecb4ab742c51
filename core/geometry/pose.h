#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// A rigid transform, named b_from_a: point_in_b = rotation * point_in_a + translation.  Metres.
// A camera's pose is its `cam_from_world`; camera frame as in COLMAP: x right, y down, z forward.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
  // c_from_b * b_from_a = c_from_a
  Pose operator*(const Pose& other) const {
    return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
  }
  Pose Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
  // Of a cam_from_world: where the camera stands, and the direction in which it looks, in the world frame.
  Eigen::Vector3d Center() const { return -(rotation.conjugate() * translation); }
  Eigen::Vector3d ViewingDirection() const { return rotation.conjugate() * Eigen::Vector3d::UnitZ(); }
  Eigen::Matrix<double, 3, 4> Matrix() const {
    Eigen::Matrix<double, 3, 4> matrix;
    matrix << rotation.toRotationMatrix(), translation;
    return matrix;
  }
};

inline double DegFromRad(double rad) { return rad * 180.0 / std::numbers::pi; }
inline double RadFromDeg(double deg) { return deg * std::numbers::pi / 180.0; }

// Angle of the rotation between two poses, degrees in [0, 180].
inline double RotationErrorDeg(const Pose& a, const Pose& b) {
  return DegFromRad(a.rotation.angularDistance(b.rotation));
}
// Distance between the centres of two cameras, metres.
inline double CenterErrorM(const Pose& a, const Pose& b) { return (a.Center() - b.Center()).norm(); }

}  // namespace cairn
