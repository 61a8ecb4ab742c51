#include "core/camera/camera_turn.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace cairn {
namespace {

// Where a level pinhole at a place and height that looks along `heading_rad` sees a point.
Eigen::Vector2d Project(const Eigen::Vector3d& point, const Eigen::Vector3d& centre, double heading_rad,
                        double focal_px) {
  const Eigen::Vector3d forward(std::cos(heading_rad), std::sin(heading_rad), 0);
  const Eigen::Vector3d right(std::sin(heading_rad), -std::cos(heading_rad), 0), down(0, 0, -1);
  const Eigen::Vector3d ray = point - centre;
  return focal_px / ray.dot(forward) * Eigen::Vector2d(ray.dot(right), ray.dot(down));
}

TEST(RiseOf, IsWhatAHigherPinholeSees) {
  const Eigen::Vector3d centre(1, 2, 1.1);
  constexpr double kStep = 1e-6, kFocalPx = 320;
  for (const double heading : {0.0, 0.7, std::numbers::pi / 2, 3.0, 5.5}) {
    const Eigen::Vector3d point =
        centre + Eigen::Vector3d(3 * std::cos(heading + 0.2), 3 * std::sin(heading + 0.2), -0.4);
    const Eigen::Vector2d seen = Project(point, centre, heading, kFocalPx);
    Eigen::Matrix<double, 3, 2> gradient = Eigen::Matrix<double, 3, 2>::Zero();
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector3d moved = centre + kStep * Eigen::Vector3d::Unit(axis);
      gradient.col(axis).head<2>() = (Project(point, moved, heading, kFocalPx) - seen) / kStep;
    }
    const Eigen::Vector3d higher = centre + kStep * Eigen::Vector3d::UnitZ();
    const double expected = (Project(point, higher, heading, kFocalPx) - seen).y() / kStep;
    EXPECT_NEAR(RiseOf(gradient, heading), expected, 1e-3);
    EXPECT_NEAR(expected, kFocalPx / (3 * std::cos(0.2)), 1e-3);
  }
}

TEST(RiseOf, NothingRisesTowardsTheCamera) {
  // Noise: as if the thing stood behind the camera.
  Eigen::Matrix<double, 3, 2> gradient = Eigen::Matrix<double, 3, 2>::Zero();
  gradient(0, 1) = -5;
  EXPECT_EQ(RiseOf(gradient, 0), 0);
}

}  // namespace
}  // namespace cairn
