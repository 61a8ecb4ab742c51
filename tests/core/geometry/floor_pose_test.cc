#include "core/geometry/floor_pose.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

// The cam_from_world, z up, of a camera at a place: it looks along the heading, up by the pitch, and is then
// turned clockwise about the way it looks.
Pose LooksTo(double heading_deg, double pitch_deg, double roll_deg, const Eigen::Vector3d& center) {
  const auto turn = [](double deg, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(RadFromDeg(deg), axis);
  };
  Eigen::Matrix3d level;  // columns: right, down and forward of a camera that looks along +x
  level << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Pose world_from_cam;
  world_from_cam.rotation = Eigen::Quaterniond(turn(heading_deg, Eigen::Vector3d::UnitZ()) * level *
                                               turn(pitch_deg, Eigen::Vector3d::UnitX()) *
                                               turn(roll_deg, Eigen::Vector3d::UnitZ()));
  world_from_cam.translation = center;
  return world_from_cam.Inverse();
}

TEST(FloorPoseOf, IsWhereTheCameraStandsAndLooks) {
  for (const double heading_deg : {0.5, 45.0, 90.0, 179.0, 181.0, 270.0, 359.5}) {
    for (const double pitch_deg : {-60.0, 0.0, 40.0}) {
      const FloorPose pose = FloorPoseOf(LooksTo(heading_deg, pitch_deg, 20, {3, -4, 1.5}), Pose());
      EXPECT_LT((pose.position - Eigen::Vector2d(3, -4)).norm(), 1e-12);
      EXPECT_NEAR(pose.heading_deg, heading_deg, 1e-9);
    }
  }
  const double along_x = FloorPoseOf(LooksTo(0, 0, 0, {0, 0, 0}), Pose()).heading_deg;
  EXPECT_NEAR(AngleBetweenDeg(along_x, 0), 0, 1e-9);
  EXPECT_GE(along_x, 0);
}

TEST(FloorPoseOf, Within15DegreesOfTheVerticalTheTopOfTheImageIsAhead) {
  // Turned by a quarter, the top points to the right when it is level: 90 degrees less.  cos 74.5 = 0.267,
  // cos 75.5 = 0.250.
  for (const double sign : {1.0, -1.0}) {
    EXPECT_NEAR(FloorPoseOf(LooksTo(200, sign * 74.5, 90, {0, 0, 0}), Pose()).heading_deg, 200, 1e-9);
    EXPECT_NEAR(FloorPoseOf(LooksTo(200, sign * 75.5, 90, {0, 0, 0}), Pose()).heading_deg, 110, 1e-9);
  }
  EXPECT_NEAR(FloorPoseOf(LooksTo(200, -90, 0, {0, 0, 0}), Pose()).heading_deg, 200, 1e-9);
}

TEST(FloorPoseOf, AHeadingHardlyBelowZeroIsNoWholeTurn) {
  for (const double turn_rad : {-1e-14, -3e-16, -1e-16, 0.0, 3e-16}) {
    Pose floor_from_world;
    floor_from_world.rotation = Eigen::Quaterniond(1, 0, 0, 0.5 * turn_rad);
    const double heading_deg = FloorPoseOf(LooksTo(0, 0, 0, {0, 0, 0}), floor_from_world).heading_deg;
    EXPECT_GE(heading_deg, 0) << turn_rad;
    EXPECT_LT(heading_deg, 360) << turn_rad;
    EXPECT_NEAR(AngleBetweenDeg(heading_deg, 0), 0, 1e-9) << turn_rad;
  }
}

TEST(FloorPoseOf, IsInTheFrameOfTheFloor) {
  // The world's y points up.
  Pose floor_from_world;
  floor_from_world.rotation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX());
  floor_from_world.translation = {10, 20, 0};
  for (const double pitch_deg : {0.0, -90.0}) {
    const Pose cam_from_floor = LooksTo(30, pitch_deg, 0, {3, -4, 1.5});
    const FloorPose pose = FloorPoseOf(cam_from_floor * floor_from_world, floor_from_world);
    EXPECT_LT((pose.position - Eigen::Vector2d(3, -4)).norm(), 1e-12);
    EXPECT_NEAR(pose.heading_deg, 30, 1e-9);
  }
}

}  // namespace
}  // namespace cairn
