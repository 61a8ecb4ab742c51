#pragma once

#include <Eigen/Core>
#include <Eigen/SVD>

namespace cairn {

// The rotation R with the largest trace of R^T M: nearest to M, and of M = sum of b a^T the one that turns
// the vectors a into b best [Umeyama91].
inline Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

}  // namespace cairn
