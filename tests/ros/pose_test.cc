#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/gravity.h"
#include "ros/grey_pixels.h"
#include "ros/odometry.h"
#include "ros/robot_pose.h"

namespace cairn {
namespace {

using testing::HasSubstr;

// Views on bytes that all are `value`.
class Bytes {
 public:
  Bytes(size_t num_bytes, uint8_t value) : bytes_(num_bytes, value) {}
  ImageView View(const std::string& encoding, uint32_t width, uint32_t height, uint32_t step) const {
    return {encoding, width, height, step, bytes_.data(), bytes_.size()};
  }
  std::vector<uint8_t> bytes_;
};

TEST(GreyPixels, AreThoseOfTheMessageWhereTheyAreGrey) {
  const Bytes bytes(8, 10);
  const cv::Mat grey = *GreyPixels(bytes.View("mono8", 3, 2, 4));
  EXPECT_EQ(grey.data, bytes.bytes_.data());
  EXPECT_EQ(grey.step, 4u);
  EXPECT_EQ(grey.size(), cv::Size(3, 2));
}

TEST(GreyPixels, TellRedFromBlue) {
  Bytes bytes(3, 0);
  bytes.bytes_[0] = 200;
  EXPECT_EQ(GreyPixels(bytes.View("rgb8", 1, 1, 3))->at<uint8_t>(0, 0), 60);  // 0.299 * 200
  EXPECT_EQ(GreyPixels(bytes.View("bgr8", 1, 1, 3))->at<uint8_t>(0, 0), 23);  // 0.114 * 200
}

TEST(GreyPixels, RefuseWhatDoesNotFit) {
  const Bytes bytes(12, 10);
  EXPECT_EQ(GreyPixels(bytes.View("bayer_rggb8", 3, 2, 3)).error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(GreyPixels(bytes.View("16UC1", 3, 2, 6)).error().message, HasSubstr("'16UC1'"));
  for (const ImageView& view :
       {bytes.View("rgb8", 3, 2, 8), bytes.View("mono8", 3, 5, 3), bytes.View("mono8", 0, 2, 3),
        bytes.View("mono8", 3, 2, 1u << 31), bytes.View("rgb8", 1u << 31, 1, 3)}) {
    EXPECT_EQ(GreyPixels(view).error().code, ErrorCode::kInvalidArgument);
  }
}

// A camera at (1, 2, 3) that looks along the map's +x: its z is the map's x, its x the map's -y, its y the
// map's -z.
Localization FixLookingAlongX() {
  Localization fix;
  fix.reason = NoFix::kNone;
  Eigen::Matrix3d cam_from_world;
  cam_from_world << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  fix.cam_from_world.rotation = Eigen::Quaterniond(cam_from_world);
  fix.cam_from_world.translation = -(cam_from_world * Eigen::Vector3d(1, 2, 3));
  return fix;
}

TEST(RobotPose, VariancesGoToTheAxesOfTheMap) {
  Localization fix = FixLookingAlongX();
  fix.covariance =
      Eigen::Vector<double, 6>(1, 2, 3, 4, 5, 6).asDiagonal();  // about and along the camera's x, y, z
  const RobotPose found = RobotPoseOf(fix, Pose());
  EXPECT_LT((found.position - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  const double expected[] = {6, 4, 5, 3, 1, 2};  // the map's x is the camera's z, y its -x, z its -y
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) EXPECT_NEAR(found.covariance(i, j), i == j ? expected[i] : 0, 1e-12);
}

TEST(RobotPose, CovarianceIsThatOfPerturbedPosesWithAMountedCamera) {
  Localization fix = FixLookingAlongX();
  const Pose robot_from_camera = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.3, -0.1, 0.8}};
  // The Jacobian by differences: perturbed fixes, seen as poses of the robot.
  const auto robot_of = [&](const Eigen::Vector<double, 6>& d) {
    const Eigen::Vector3d r = d.head<3>();
    const double angle = r.norm();
    const Pose perturbation = {
        angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, r / angle)) : Eigen::Quaterniond::Identity(),
        d.tail<3>()};
    return (robot_from_camera * (perturbation * fix.cam_from_world)).Inverse();
  };
  const Pose robot = robot_of(Eigen::Vector<double, 6>::Zero());
  Matrix6d jacobian;
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Pose moved = robot_of(kStep * Eigen::Vector<double, 6>::Unit(i));
    const Eigen::AngleAxisd turn(moved.rotation * robot.rotation.conjugate());  // in the map's fixed axes
    jacobian.col(i) << (moved.translation - robot.translation) / kStep, turn.angle() * turn.axis() / kStep;
  }
  Matrix6d root = Matrix6d::Identity();
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) += 0.1 * std::sin(i);
  fix.covariance = root * root.transpose();
  const RobotPose found = RobotPoseOf(fix, robot_from_camera);
  EXPECT_LT((found.position - robot.translation).norm(), 1e-12);
  EXPECT_LT(found.orientation.angularDistance(robot.rotation), 1e-7);
  const Matrix6d expected = jacobian * fix.covariance * jacobian.transpose();
  EXPECT_LT((found.covariance - expected).norm(), 1e-4);
}

// x right, y down, z forward, turned to the left about the robot's z.
Pose CameraMountedAt(double ahead_m, double left_m, double turn_left_rad) {
  Eigen::Matrix3d axes;
  axes << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn_left_rad, Eigen::Vector3d::UnitZ()) *
                             Eigen::Quaterniond(axes)),
          {ahead_m, left_m, 0.8}};
}

TEST(CameraOnFloor, LooksAlongItsOpticalAxis) {
  const PlanarPose pose = CameraOnFloor(CameraMountedAt(0.3, -0.1, 0.4));
  EXPECT_NEAR(pose.position.x(), 0.3, 1e-12);
  EXPECT_NEAR(pose.position.y(), -0.1, 1e-12);
  EXPECT_NEAR(pose.heading_rad, 0.4, 1e-12);
  EXPECT_EQ(CameraOnFloor(Pose()).heading_rad, 0);  // without a mounting
  // One that looks up, its image's top to the robot's left.
  Eigen::Matrix3d robot_from_camera;
  robot_from_camera.col(0) = Eigen::Vector3d::UnitX() * -1;  // right
  robot_from_camera.col(1) = Eigen::Vector3d::UnitY() * -1;  // down
  robot_from_camera.col(2) = Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(CameraOnFloor({Eigen::Quaterniond(robot_from_camera), {0, 0, 1}}).heading_rad,
              std::numbers::pi / 2, 1e-12);
}

//  odometry:  y ^    2      1: at (2, 1), looks along y    2: at (2, 3), looks along -x
//               |
//               |    1      The camera is 0.5 m ahead of the robot and looks to its left.
//               +------> x
TEST(Odometry, SaysHowTheMountedCameraMoved) {
  Odometry odometry(CameraMountedAt(0.5, 0, std::numbers::pi / 2));
  ASSERT_TRUE(odometry.Add(1, {{2, 1}, std::numbers::pi / 2}).ok());
  EXPECT_FALSE(odometry.MoveTo(1));  // the first image
  ASSERT_TRUE(odometry.Add(2, {{2, 3}, std::numbers::pi}).ok());
  const std::optional<FloorMotion> move = odometry.MoveTo(2);
  ASSERT_TRUE(move);
  // From (2, 1.5), looking along -x, to (1.5, 3).
  EXPECT_NEAR(move->way_m.x(), 0.5, 1e-12);
  EXPECT_NEAR(move->way_m.y(), -1.5, 1e-12);
  EXPECT_NEAR(move->turn_left_rad, std::numbers::pi / 2, 1e-12);
  EXPECT_NEAR(odometry.MoveTo(2)->way_m.norm(), 0, 1e-12);  // it stands
}

TEST(Odometry, TakesTheImagesTimeBetweenTwoPoses) {
  Odometry odometry{Pose()};
  ASSERT_TRUE(odometry.Add(1, {{0, 0}, 3}).ok());
  ASSERT_TRUE(odometry.Add(3, {{4, 0}, -3}).ok());  // on by 0.28 rad, past pi
  EXPECT_FALSE(odometry.MoveTo(0.5));               // before odometry began
  EXPECT_FALSE(odometry.MoveTo(1));
  const std::optional<FloorMotion> move = odometry.MoveTo(1.5);
  ASSERT_TRUE(move);
  EXPECT_NEAR(move->way_m.norm(), 1, 1e-12);
  EXPECT_NEAR(move->turn_left_rad, 0.25 * (2 * std::numbers::pi - 6), 1e-12);
  EXPECT_NEAR(odometry.MoveTo(3.4)->way_m.norm(), 3, 1e-12);  // a little after the last one: there
  EXPECT_NEAR(odometry.MoveTo(0)->way_m.norm(), 0, 1e-12);    // now
  EXPECT_FALSE(odometry.MoveTo(4.1));  // odometry that has ended does not say that the robot stands
  EXPECT_FALSE(odometry.MoveTo(3));    // nor from where it drove meanwhile
  EXPECT_TRUE(odometry.MoveTo(3.1));
}

TEST(Odometry, BeginsAnewWhereTimeGoesBackAndRefusesWhatIsNotFinite) {
  Odometry odometry{Pose()};
  ASSERT_TRUE(odometry.Add(5, {{1, 0}, 0}).ok());
  EXPECT_FALSE(odometry.MoveTo(5));
  ASSERT_TRUE(odometry.Add(5, {{2, 0}, 0}).ok());  // of the same time: the later one counts
  EXPECT_NEAR(odometry.MoveTo(5)->way_m.x(), 1, 1e-12);
  ASSERT_TRUE(odometry.Add(1, {{7, 0}, 0}).ok());
  EXPECT_FALSE(odometry.MoveTo(1));  // it did not drive from one recording to the other
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(odometry.Add(2, {{nan, 0}, 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(odometry.Add(2, {{0, 0}, nan}).ok());
  EXPECT_FALSE(odometry.Add(nan, {{0, 0}, 0}).ok());
  ASSERT_TRUE(odometry.MoveTo(1.4));
  EXPECT_NEAR(odometry.MoveTo(1.4)->way_m.x(), 0, 1e-12);
}

// An IMU whose x is up where the camera's y is down.
TEST(Gravity, IsWhatWasSaidNearestToTheImageInItsCamerasFrame) {
  const Eigen::Quaterniond camera_from_imu =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitY());
  Gravity gravity(camera_from_imu, 1.5);
  EXPECT_FALSE(gravity.At(0));
  ASSERT_TRUE(gravity.Add(10, {9.81, 0, 0}).ok());
  ASSERT_TRUE(gravity.Add(10.06, {0, 9.81, 0}).ok());
  ASSERT_TRUE(gravity.At(10.02));
  EXPECT_LT((gravity.At(10.02)->direction - Eigen::Vector3d(0, -9.81, 0)).norm(), 1e-9);
  EXPECT_EQ(gravity.At(10.02)->sigma_deg, 1.5);
  const Eigen::Vector3d second = camera_from_imu * Eigen::Vector3d(0, 9.81, 0);
  for (const double image_time_s : {10.04, 10.06, 10.15, 0.0})
    EXPECT_LT((gravity.At(image_time_s)->direction - second).norm(), 1e-9) << image_time_s;
  EXPECT_LT((gravity.At(9.91)->direction - Eigen::Vector3d(0, -9.81, 0)).norm(), 1e-9);
  for (const double too_far : {9.89, 10.17}) EXPECT_FALSE(gravity.At(too_far)) << too_far;
  ASSERT_TRUE(gravity.Add(11, {1, 0, 0}, 2).ok());
  EXPECT_DOUBLE_EQ(gravity.At(11)->sigma_deg, 2.5);
  // A recording begins again.
  ASSERT_TRUE(gravity.Add(2, {9.81, 0, 0}).ok());
  EXPECT_FALSE(gravity.At(10.02));
  EXPECT_TRUE(gravity.At(2));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(gravity.Add(3, {0, 0, 0}).ok());
  EXPECT_FALSE(gravity.Add(3, {nan, 0, 0}).ok());
  EXPECT_FALSE(gravity.Add(nan, {1, 0, 0}).ok());
  EXPECT_FALSE(gravity.At(3));
  // Of minutes of an IMU the last seconds are known.
  for (int i = 0; i < 10000; ++i) ASSERT_TRUE(gravity.Add(20 + 0.001 * i, {1, 0, 0}).ok());
  EXPECT_TRUE(gravity.At(29.9));
  EXPECT_FALSE(gravity.At(25.5));
}

}  // namespace
}  // namespace cairn
