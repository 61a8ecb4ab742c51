#pragma once

#include <cmath>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/two_view_error.h"

namespace cairn {

// Points that two cameras see, each bearing moved by some noise; then outliers, which are anywhere ahead.
struct SeenByTwo {
  Pose cam2_from_cam1;
  Correspondences correspondences;
};

inline Eigen::Vector3d Moved(const Eigen::Vector3d& bearing, double noise_rad, Random* random) {
  Eigen::Vector3d moved = bearing;
  for (double& value : moved) value += random->Normal(0, noise_rad);
  return moved.normalized();
}

// Points at 2 to 6 m ahead of the first camera; on the plane 0.3 x + z = 4 if `is_flat`.
inline SeenByTwo SeePoints(int num_points, double noise_rad, int num_outliers = 0, bool is_flat = false) {
  SeenByTwo seen;
  seen.cam2_from_cam1.rotation = Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.3, 1, -0.2).normalized());
  seen.cam2_from_cam1.translation = Eigen::Vector3d(-0.6, 0.1, 0.3).normalized();
  Random random(num_points + num_outliers);
  const auto ahead = [&](double low, double high) {
    const double x = random.Uniform(-1.5, 1.5), y = random.Uniform(-1.5, 1.5);
    return Eigen::Vector3d(x, y, random.Uniform(low, high));
  };
  for (int i = 0; i < num_points + num_outliers; ++i) {
    Eigen::Vector3d point = ahead(2, 6);
    if (is_flat) point.z() = 4 - 0.3 * point.x();
    const bool is_outlier = i >= num_points;
    const Eigen::Vector3d in_second = is_outlier ? ahead(2, 3) : seen.cam2_from_cam1 * point;
    const Eigen::Vector3d bearing1 = Moved(point.normalized(), noise_rad, &random);
    seen.correspondences.Add(bearing1, Moved(in_second.normalized(), noise_rad, &random), i);
  }
  return seen;
}

}  // namespace cairn
