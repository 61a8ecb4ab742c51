#include "runtime/belief/image_places.h"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "core/base/random.h"
#include "core/blocks/map_head.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

// A camera 1.2 m above the floor that looks along `heading_rad`, level; image: x right, y down, z ahead.
Pose CameraAt(double x, double y, double heading_rad) {
  Eigen::Matrix3d floor_from_cam;
  const double c = std::cos(heading_rad), s = std::sin(heading_rad);
  floor_from_cam << s, 0, c, -c, 0, s, 0, -1, 0;
  const Pose floor{Eigen::Quaterniond(floor_from_cam), {x, y, 1.2}};
  return floor.Inverse();
}

Localization Fix(const Pose& cam_from_world) {
  Localization found;
  found.reason = NoFix::kNone;
  found.cam_from_world = cam_from_world;
  found.covariance = 1e-4 * Matrix6d::Identity();
  found.probability = 0.97;
  return found;
}

TEST(PlacesOf, TheRobotStandsWhereItsCameraSaysThatItDoes) {
  // The laser is 0.3 m behind the camera and 0.1 to its left, and looks to the left.
  const auto places = PlacesOf(Fix(CameraAt(3, 4, 0.5)), MapHead(), {{-0.3, 0.1}, std::numbers::pi / 2});
  ASSERT_EQ(places.size(), 1u);
  EXPECT_NEAR(places[0].pose.position.x(), 3 - 0.3 * std::cos(0.5) - 0.1 * std::sin(0.5), 1e-12);
  EXPECT_NEAR(places[0].pose.position.y(), 4 - 0.3 * std::sin(0.5) + 0.1 * std::cos(0.5), 1e-12);
  EXPECT_NEAR(places[0].pose.heading_rad, 0.5 + std::numbers::pi / 2, 1e-12);
  EXPECT_EQ(places[0].probability, 0.97);
}

// A map whose frame is not the floor's, and a capture that states another frame than the camera's.
TEST(PlacesOf, FramesOfTheMapAndOfTheCaptureCount) {
  MapHead head;
  head.floor_from_world = {Eigen::Quaterniond(Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, 3).normalized())),
                           {5, -2, 1}};
  head.camera_from_given = {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(3, -2, 1).normalized())), {0.1, 0.2, 0.3}};
  const Pose cam_from_floor = CameraAt(3, 4, -2);
  Localization found = Fix(head.camera_from_given.Inverse() * cam_from_floor * head.floor_from_world);
  const PlanarPose mount{{-0.4, 0.2}, 0.3};
  const auto places = PlacesOf(found, head, mount);
  ASSERT_EQ(places.size(), 1u);
  const PlanarPose camera{{3, 4}, -2};
  EXPECT_TRUE(places[0].pose.position.isApprox(camera.FloorFromRobot(mount.position), 1e-9));
  EXPECT_NEAR(places[0].pose.heading_rad, -1.7, 1e-9);
  // Its covariance is that of poses perturbed as the fix's says.
  Random random(1);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) found.covariance(i, k) = random.Normal(0, 0.01);
  }
  found.covariance = (found.covariance * found.covariance.transpose()).eval();
  const Matrix6d root = found.covariance.llt().matrixL();
  const auto expected = PlacesOf(found, head, mount)[0];
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  constexpr int kNum = 100000;
  constexpr double kSmall = 0.05;
  for (int i = 0; i < kNum; ++i) {
    Vector6d normal;
    for (double& x : normal) x = random.Normal(0, kSmall);
    const Vector6d by = root * normal;
    const Eigen::Vector3d turn = by.head<3>();
    Localization moved = found;
    const Pose perturbation{Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())),
                            by.tail<3>()};
    moved.cam_from_world = perturbation * found.cam_from_world;
    const PlanarPose pose = PlacesOf(moved, head, mount)[0].pose;
    Eigen::Vector3d off;
    off << pose.position - expected.pose.position, WrapAngle(pose.heading_rad - expected.pose.heading_rad);
    second += off * off.transpose() / (kNum * kSmall * kSmall);
  }
  EXPECT_TRUE(second.isApprox(expected.covariance, 0.03)) << second << "\n\n" << expected.covariance;
}

TEST(PlacesOf, LookAlikesAreSeveralPlaces) {
  Localization found;
  found.reason = NoFix::kAmbiguous;
  found.possible_poses = {CameraAt(1, 2, 0), CameraAt(5, 6, 1)};
  found.possible_probabilities = {0.5, 0.4};
  const auto places = PlacesOf(found, MapHead(), {});
  ASSERT_EQ(places.size(), 2u);
  EXPECT_TRUE(places[1].pose.position.isApprox(Eigen::Vector2d(5, 6)));
  EXPECT_NEAR(places[1].pose.heading_rad, 1, 1e-12);
  EXPECT_EQ(places[1].probability, 0.4);
  EXPECT_NEAR(std::sqrt(places[0].covariance(0, 0)), 0.3, 1e-9);
  EXPECT_NEAR(DegFromRad(std::sqrt(places[0].covariance(2, 2))), 5, 1e-9);
  EXPECT_TRUE(places[0].covariance.isApprox(
      Eigen::Vector3d(0.09, 0.09, std::pow(RadFromDeg(5), 2)).asDiagonal().toDenseMatrix()));
  // A pose or a probability too many says nothing.
  found.possible_probabilities = {0.5};
  EXPECT_EQ(PlacesOf(found, MapHead(), {}).size(), 1u);
  found.possible_probabilities = {0.4, 0.3, 0.2};
  EXPECT_EQ(PlacesOf(found, MapHead(), {}).size(), 2u);
  found.possible_probabilities.clear();
  EXPECT_TRUE(PlacesOf(found, MapHead(), {}).empty());
  EXPECT_TRUE(PlacesOf(Localization(), MapHead(), {}).empty());
}

}  // namespace
}  // namespace cairn
