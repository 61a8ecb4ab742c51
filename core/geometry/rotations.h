#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace cairn {

// The rotation by a vector, about it by its length; and back, in [0, pi].  T: double, or one of automatic
// derivatives.
template <typename T>
Eigen::Quaternion<T> QuaternionFromVector(const Eigen::Matrix<T, 3, 1>& v) {
  using std::cos, std::sin, std::sqrt;
  const T squared = v.squaredNorm();
  if (squared < T(1e-16)) return Eigen::Quaternion<T>(T(1), v.x() / T(2), v.y() / T(2), v.z() / T(2));
  const T angle = sqrt(squared), half = angle / T(2), part = sin(half) / angle;
  return Eigen::Quaternion<T>(cos(half), part * v.x(), part * v.y(), part * v.z());
}

template <typename T>
Eigen::Matrix<T, 3, 1> VectorFromQuaternion(const Eigen::Quaternion<T>& q) {
  using std::atan2, std::sqrt;
  const T sign = q.w() < T(0) ? T(-1) : T(1);
  const T squared = q.vec().squaredNorm();
  if (squared < T(1e-16)) return T(2) * sign * q.vec();
  const T sine = sqrt(squared);
  return (T(2) * atan2(sine, sign * q.w()) / sine) * sign * q.vec();
}

// The rotation R with the largest trace of R^T M: nearest to M, and of M = sum of b a^T the one that turns
// the vectors a into b best [Umeyama91].
inline Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

}  // namespace cairn
