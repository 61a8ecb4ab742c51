#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// Matches of two images as unit bearings in their camera frames; `match_idx` is the match behind each.
struct Correspondences {
  std::vector<Eigen::Vector3d> bearings1, bearings2;
  std::vector<int> match_idx;

  int size() const { return static_cast<int>(bearings1.size()); }
  void Add(const Eigen::Vector3d& bearing1, const Eigen::Vector3d& bearing2, int idx) {
    bearings1.push_back(bearing1);
    bearings2.push_back(bearing2);
    match_idx.push_back(idx);
  }
};

// First-order distance of a correspondence to the epipolar constraint b2' E b1 = 0, squared, rad^2: the
// Sampson error [Hartley & Zisserman 2004, 11.4.3] with the gradient taken in the tangent planes of the two
// unit bearings, so that it holds for any field of view.  NaN for NaN.
inline double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector3d& bearing1,
                                  const Eigen::Vector3d& bearing2) {
  const Eigen::Vector3d normal2 = E * bearing1;
  const Eigen::Vector3d normal1 = E.transpose() * bearing2;
  const double residual = bearing2.dot(normal2);
  // Both normals have the component `residual` along their bearing; the rest lies in the tangent plane.
  const double gradient2 = normal1.squaredNorm() + normal2.squaredNorm() - 2 * residual * residual;
  return residual * residual / std::max(gradient2, 1e-18);
}

// Whether two rays, unit vectors in one frame, come closest to each other in front of both: the first starts
// at the origin, the second at `baseline`, not zero.  Rays that diverge by less than tolerance_rad may do so
// because their directions are that wrong: they count.
inline bool RaysConverge(const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                         const Eigen::Vector3d& baseline, double tolerance_rad) {
  const Eigen::Vector3d axis = baseline.normalized();
  const double angle1 = std::acos(std::clamp(ray1.dot(axis), -1.0, 1.0));
  const double angle2 = std::acos(std::clamp(ray2.dot(axis), -1.0, 1.0));
  return angle2 - angle1 >= -tolerance_rad;
}

// Distance of the second bearing from where the homography takes the first one, squared, rad^2 (as a chord).
inline double SquaredTransferError(const Eigen::Matrix3d& H, const Eigen::Vector3d& bearing1,
                                   const Eigen::Vector3d& bearing2) {
  return ((H * bearing1).normalized() - bearing2).squaredNorm();
}

}  // namespace cairn
