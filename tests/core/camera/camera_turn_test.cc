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

// What is ahead moves to the right, then down; what is to the right rises.
TEST(CameraTurn, TurnsLeftThenUpThenClockwise) {
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ(), right = Eigen::Vector3d::UnitX(),
                        down = Eigen::Vector3d::UnitY();
  constexpr double kQuarter = std::numbers::pi / 2;
  EXPECT_LT((CameraTurn(kQuarter) * ahead - right).norm(), 1e-12);
  EXPECT_LT((CameraTurn(kQuarter) * down - down).norm(), 1e-12);
  EXPECT_LT((CameraTurn(0, kQuarter) * ahead - down).norm(), 1e-12);
  EXPECT_LT((CameraTurn(0, kQuarter) * right - right).norm(), 1e-12);
  EXPECT_LT((CameraTurn(0, 0, kQuarter) * right + down).norm(), 1e-12);
  EXPECT_LT((CameraTurn(0, 0, kQuarter) * ahead - ahead).norm(), 1e-12);
  EXPECT_LT(
      (CameraTurn(0.3, -0.2, 0.5) - CameraTurn(0, 0, 0.5) * CameraTurn(0, -0.2) * CameraTurn(0.3)).norm(),
      1e-12);
}

TEST(TurnedSight, MovesAndGrowsAsTheImageDoes) {
  constexpr double kFocalPx = 400;
  const Eigen::Matrix3d turn = CameraTurn(0.4, -0.2, 0.3);
  for (const Eigen::Vector3d& seen : {Eigen::Vector3d(0, 0, 2), {100, -50, 1.5}, {-180, 120, -1}}) {
    const Eigen::Vector3d found = *TurnedSight(seen, turn, kFocalPx);
    const Eigen::Vector3d ray = turn * Eigen::Vector3d(seen.x(), seen.y(), kFocalPx);
    EXPECT_LT((found.head<2>() - kFocalPx * ray.hnormalized()).norm(), 1e-9);
    // The area of a square of a hundredth of a pixel becomes another; the scale is its root.
    const auto moved = [&](double x, double y) {
      return Eigen::Vector2d(TurnedSight(seen + Eigen::Vector3d(x, y, 0), turn, kFocalPx)->head<2>() -
                             found.head<2>());
    };
    const Eigen::Vector2d a = moved(0.01, 0), b = moved(0, 0.01);
    const double area_ratio = std::abs(a.x() * b.y() - a.y() * b.x()) / 1e-4;
    EXPECT_NEAR(found.z() - seen.z(), 0.5 * std::log2(area_ratio), 1e-3);
  }
}

TEST(TurnedSight, EightyDegreesOffTheAxisAreTheEnd) {
  const auto turned = [](double deg) {
    return TurnedSight({0, 0, 1}, CameraTurn(deg * std::numbers::pi / 180), 400).has_value();
  };
  EXPECT_TRUE(turned(80));
  EXPECT_TRUE(turned(-80));
  EXPECT_FALSE(turned(80.5));
  EXPECT_FALSE(turned(180));
}

}  // namespace
}  // namespace cairn
