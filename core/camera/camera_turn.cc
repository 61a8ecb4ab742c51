#include "core/camera/camera_turn.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace cairn {

std::optional<Eigen::Vector3d> TurnedSight(const Eigen::Vector3d& seen,
                                           const Eigen::Matrix3d& turned_from_camera, double focal_px) {
  constexpr double kLeastForward = 0.17;  // cos(80 degrees)
  const Eigen::Vector3d ray =
      turned_from_camera * Eigen::Vector3d(seen.x() / focal_px, seen.y() / focal_px, 1);
  if (!(ray.z() > kLeastForward * ray.norm())) return std::nullopt;
  return Eigen::Vector3d(focal_px * ray.x() / ray.z(), focal_px * ray.y() / ray.z(),
                         seen.z() - 1.5 * std::log2(ray.z()));
}

Eigen::Matrix3d CameraTurn(double left_rad, double up_rad, double clockwise_rad) {
  return (Eigen::AngleAxisd(-clockwise_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(-up_rad, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(left_rad, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

double RiseOf(const Eigen::Matrix<double, 3, 2>& gradient, double heading_rad) {
  const Eigen::Vector2d right(std::sin(heading_rad), -std::cos(heading_rad));
  return std::max(0.0, -gradient.row(0).dot(right));
}

}  // namespace cairn
