#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// [v]x: CrossMatrix(v) * w = v x w.
inline Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

// The z of the cross product of two vectors in the plane: > 0 where b points left of a.
inline double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Distance of a point from the segment between two others.
inline double PointToSegment(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double squared = along.squaredNorm();
  const double share = squared > 0 ? std::clamp((point - a).dot(along) / squared, 0.0, 1.0) : 0;
  return (point - a - share * along).norm();
}

// Two unit vectors, at right angles to each other, that span the plane orthogonal to the unit vector v.
inline Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  const Eigen::Vector3d axis = std::abs(v.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = v.cross(axis).normalized();
  basis.col(1) = v.cross(basis.col(0)).normalized();
  return basis;
}

}  // namespace cairn
