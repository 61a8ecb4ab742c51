#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

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

}  // namespace cairn
