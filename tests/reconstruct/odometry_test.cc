#include "stages/reconstruct/odometry.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/reconstruct/align.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

// A drive round a block, 0.2 m a step, as it was; the camera looks ahead and 10 degrees down:
//
//     +------<------+
//     |             |      10 x 6 m
//     +------>------+
std::vector<OdometryPose> TrueDrive(int num_images = 160) {
  std::vector<OdometryPose> drive;
  double way = 0;
  for (int i = 0; i < num_images; ++i, way += 0.2) {
    const double at = std::fmod(way, 32.0);
    double heading = 0;
    Eigen::Vector3d place(at, 0, 0.5);
    if (at >= 26) {
      heading = -90, place = {0, 32 - at, 0.5};
    } else if (at >= 16) {
      heading = 180, place = {26 - at, 6, 0.5};
    } else if (at >= 10) {
      heading = 90, place = {10, at - 10, 0.5};
    }
    Eigen::Matrix3d level;  // of a camera that looks along +x: its x is -y, its y is -z
    level.col(0) = -Eigen::Vector3d::UnitY();
    level.col(1) = -Eigen::Vector3d::UnitZ();
    level.col(2) = Eigen::Vector3d::UnitX();
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(RadFromDeg(heading), Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(RadFromDeg(10), Eigen::Vector3d::UnitY()));
    drive.push_back({fmt::format("{:04}.jpg", i), {(turn * Eigen::Quaterniond(level)).normalized(), place}});
  }
  return drive;
}

// What a mapper makes of it: some frame, some scale.
std::map<std::string, Pose> ModelOf(const std::vector<OdometryPose>& drive, double model_per_metre) {
  const Similarity model_from_world{
      model_per_metre, Eigen::Quaterniond(0.4, 0.5, -0.6, 0.2).normalized(), {3, -1, 7}};
  std::map<std::string, Pose> model;
  for (const OdometryPose& pose : drive)
    model[pose.name] = TransformPose(model_from_world, pose.world_from_cam.Inverse());
  return model;
}

// Wheels: each step's length errs by `step_ratio` (standard deviation) and the heading drifts.
std::vector<OdometryPose> WithDrift(const std::vector<OdometryPose>& drive, double step_ratio,
                                    double deg_per_step, uint64_t seed = 1) {
  Random random(seed);
  std::vector<OdometryPose> drifted = drive;
  for (size_t i = 1; i < drive.size(); ++i) {
    const Pose step = drive[i - 1].world_from_cam.Inverse() * drive[i].world_from_cam;
    const Eigen::Vector3d up = drive[i - 1].world_from_cam.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(deg_per_step), up)) * step.rotation,
                      step.translation * (1 + random.Normal(0, step_ratio))};
    drifted[i].world_from_cam = drifted[i - 1].world_from_cam * turned;
  }
  return drifted;
}

TEST(AlignToOdometry, ExactOdometryGivesExactPoses) {
  const auto drive = TrueDrive();
  const auto model = ModelOf(drive, 0.37);
  const auto alignment = AlignToOdometry(drive, model);
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale, 1 / 0.37, 1e-9);
  for (const OdometryPose& pose : drive) {
    const Pose found = TransformPose(alignment->world_from_model, model.at(pose.name));
    EXPECT_LT(CenterErrorM(found, pose.world_from_cam.Inverse()), 1e-9);
    EXPECT_LT(RotationErrorDeg(found, pose.world_from_cam.Inverse()), 1e-5);
  }
  EXPECT_GT(alignment->windows.size(), 20u);
}

TEST(AlignToOdometry, WhatDriftsOverLongWaysIsRightOverShortOnes) {
  const auto drive = TrueDrive(300);
  const auto drifted = WithDrift(drive, 0.02, 0.5);
  // 150 degrees off at the end.
  ASSERT_GT(RotationErrorDeg(drifted.back().world_from_cam, drive.back().world_from_cam), 140);
  const auto alignment = AlignToOdometry(drifted, ModelOf(drive, 2.5));
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale * 2.5, 1, 0.01);
  EXPECT_LT(std::abs(alignment->world_from_model.scale * 2.5 - 1), 4 * alignment->scale_sigma_ratio);
  EXPECT_LT(alignment->scale_sigma_ratio, 0.01);
}

TEST(AlignToOdometry, UpIsTheOdometrysAndNotTheCameras) {
  const auto drive = TrueDrive();
  const auto model = ModelOf(drive, 1);
  const auto alignment = AlignToOdometry(drive, model);
  ASSERT_TRUE(alignment.ok());
  const Eigen::Vector3d up = model.begin()->second.rotation.conjugate() *
                             (drive[0].world_from_cam.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  EXPECT_LT((alignment->world_from_model.rotation * up - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
}

TEST(AlignToOdometry, AJumpIsOffAndChangesNothing) {
  const auto drive = TrueDrive();
  auto jumped = drive;
  for (size_t i = 70; i < jumped.size(); ++i)
    jumped[i].world_from_cam.translation += Eigen::Vector3d(3, 8, 0);
  const auto alignment = AlignToOdometry(jumped, ModelOf(drive, 1));
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale, 1, 1e-9);
  int num_off = 0;
  for (const OdometryWindow& window : alignment->windows) {
    if (!window.is_off) continue;
    ++num_off;
    EXPECT_LE(window.first, "0069.jpg");
    EXPECT_GE(window.last, "0070.jpg");
    EXPECT_GT(window.odometry_m, window.model + 5);
  }
  EXPECT_EQ(num_off, 1);
}

TEST(AlignToOdometry, ImagesOfDifferentFoldersAreOfDifferentDrives) {
  const auto drive = TrueDrive();
  const auto names_from_70 = [](std::vector<OdometryPose> poses) {
    for (size_t i = 0; i < poses.size(); ++i) poses[i].name = (i < 70 ? "a/" : "b/") + poses[i].name;
    return poses;
  };
  auto moved = names_from_70(drive);
  for (size_t i = 70; i < moved.size(); ++i) moved[i].world_from_cam.translation += Eigen::Vector3d(3, 8, 0);
  const auto alignment = AlignToOdometry(moved, ModelOf(names_from_70(drive), 1));
  ASSERT_TRUE(alignment.ok());
  for (const OdometryWindow& window : alignment->windows) EXPECT_FALSE(window.is_off);
}

TEST(AlignToOdometry, ImagesThatAreNotInTheModelAreSteppedOver) {
  const auto drive = TrueDrive();
  auto model = ModelOf(drive, 0.5);
  for (int i = 0; i < 160; i += 3) model.erase(fmt::format("{:04}.jpg", i));
  const auto alignment = AlignToOdometry(drive, model);
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale, 2, 1e-9);
}

// 0.4 m a step, back and forth, seven steps a leg: pieces of five steps (2 m) end 2, 1.2 or 0.4 m from where
// they begin, and the last are too short to say something.
TEST(AlignToOdometry, PiecesOnWhichTheCameraComesBackDoNotCount) {
  auto drive = TrueDrive();
  double x = 0;
  for (size_t i = 0; i < drive.size(); ++i) {
    drive[i].world_from_cam.translation = {x, 0, 0};
    x += (i / 7) % 2 == 0 ? 0.4 : -0.4;
  }
  const auto alignment = AlignToOdometry(drive, ModelOf(drive, 1));
  ASSERT_TRUE(alignment.ok());
  EXPECT_LT(alignment->windows.size(), 30u);
  EXPECT_GT(alignment->windows.size(), 10u);
  for (const OdometryWindow& window : alignment->windows) EXPECT_GT(window.odometry_m, 0.5);
}

TEST(AlignToOdometry, TheScalesSigmaIsThatOfAPieceOverTheRootOfTheirNumber) {
  const auto drive = TrueDrive(300);
  const auto alignment = AlignToOdometry(WithDrift(drive, 0.1, 0), ModelOf(drive, 1));
  ASSERT_TRUE(alignment.ok());
  const auto num_on = std::count_if(alignment->windows.begin(), alignment->windows.end(),
                                    [](const OdometryWindow& window) { return !window.is_off; });
  // Seven or eight steps a piece, each 10 % off.
  EXPECT_NEAR(alignment->spread_ratio, 0.1 / std::sqrt(7.5), 0.015);
  EXPECT_NEAR(alignment->scale_sigma_ratio * std::sqrt(num_on), alignment->spread_ratio, 1e-12);
}

TEST(AlignToOdometry, NoWayGivesNoScale) {
  auto standing = TrueDrive();
  for (OdometryPose& pose : standing) pose.world_from_cam.translation = {1, 2, 3};
  const auto none = AlignToOdometry(standing, ModelOf(TrueDrive(), 1));
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
  EXPECT_THAT(none.error().message, HasSubstr("160 registered images moves over 0 pieces of way"));
  EXPECT_FALSE(AlignToOdometry({}, {}).ok());
  EXPECT_FALSE(AlignToOdometry(TrueDrive(10), ModelOf(TrueDrive(10), 1)).ok());  // one piece
}

TEST(MotionsOf, GoFromEachImageToTheNextOfItsFolder) {
  MapperInput input;
  for (const char* name : {"b/0.jpg", "a/0.jpg", "a/2.jpg", "a/1.jpg", "b/1.jpg"})
    input.images.push_back({static_cast<ImageId>(input.images.size() + 10), name, 1});
  std::vector<OdometryPose> odometry;
  for (const char* name : {"a/0.jpg", "b/0.jpg", "a/lost.jpg", "a/1.jpg", "b/1.jpg", "a/2.jpg"}) {
    const double turn = 0.1 * static_cast<double>(odometry.size());
    odometry.push_back({name,
                        {Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())),
                         Eigen::Vector3d(static_cast<double>(odometry.size()), 0, 1)}});
  }
  const std::vector<ImageMotion> motions = MotionsOf(odometry, input);
  ASSERT_EQ(motions.size(), 3u);
  EXPECT_EQ(std::pair(motions[0].image1, motions[0].image2), std::pair(1, 3));  // a/0, a/1
  EXPECT_EQ(std::pair(motions[1].image1, motions[1].image2), std::pair(0, 4));  // b/0, b/1
  EXPECT_EQ(std::pair(motions[2].image1, motions[2].image2), std::pair(3, 2));  // a/1, a/2
  // Three metres ahead as the first camera, which is not turned, sees it; and turned by 0.3.
  EXPECT_TRUE(motions[0].Way().isApprox(Eigen::Vector3d(3, 0, 0)));
  EXPECT_NEAR(RotationErrorDeg(motions[0].cam2_from_cam1, Pose()), DegFromRad(0.3), 1e-9);
  EXPECT_TRUE(MotionsOf({}, input).empty());
}

}  // namespace
}  // namespace cairn::reconstruct
