#include "stages/reconstruct/view_graph/image_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

// Ahead by a metre, and a turn to the left about the camera's y axis, which points down.
Pose Step(double turn_deg, double way_m = 1) {
  const Eigen::Quaterniond cam2_from_cam1(Eigen::AngleAxisd(RadFromDeg(turn_deg), Eigen::Vector3d::UnitY()));
  return {cam2_from_cam1, -(cam2_from_cam1 * Eigen::Vector3d(0, 0, way_m))};
}

ViewPair PairOf(int image1, const Pose& cam2_from_cam1, int num_matches = 50) {
  ViewPair pair;
  pair.image1 = image1;
  pair.image2 = image1 + 1;
  pair.cam2_from_cam1 = cam2_from_cam1;
  pair.cam2_from_cam1.translation.normalize();
  pair.matches.resize(num_matches);
  return pair;
}

// A drive of ten steps which turns by four degrees in each, and pairs that say the same.
struct Drive {
  std::vector<ImageMotion> motions;
  std::vector<ViewPair> pairs;
};

Drive MakeDrive() {
  Drive drive;
  for (int i = 0; i < 10; ++i) {
    drive.motions.push_back({i, i + 1, Step(4)});
    drive.pairs.push_back(PairOf(i, Step(4.5)));
  }
  return drive;
}

TEST(ImageMotion, ItsWayIsThatOfTheCentreInTheFirstCamerasFrame) {
  EXPECT_TRUE((ImageMotion{0, 1, Step(30, 2)}.Way().isApprox(Eigen::Vector3d(0, 0, 2))));
  EXPECT_EQ(MedianWayM({}), 0);
  EXPECT_NEAR(MedianWayM({{0, 1, Step(0, 1)}, {1, 2, Step(0, 4)}, {2, 3, Step(0, 9)}}), 4, 1e-12);
}

TEST(LeaveOutContradicted, WhatAgreesStays) {
  Drive drive = MakeDrive();
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 10u);
  EXPECT_EQ(LeaveOutContradicted({}, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 10u);
  // Of images that were given the other way round.
  for (ViewPair& pair : drive.pairs) {
    std::swap(pair.image1, pair.image2);
    pair.cam2_from_cam1 = pair.cam2_from_cam1.Inverse();
  }
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 10u);
}

TEST(LeaveOutContradicted, ATurnOfItsOwnIsAJump) {
  Drive drive = MakeDrive();
  drive.motions[3].cam2_from_cam1 = Step(10);    // 5.5 degrees more than the pair says
  drive.motions[5].cam2_from_cam1 = Step(-0.4);  // 4.9 less
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  ASSERT_EQ(drive.motions.size(), 9u);
  EXPECT_EQ(drive.motions[3].image1, 4);
}

TEST(LeaveOutContradicted, LargeTurnsMayDifferByHalf) {
  Drive drive = MakeDrive();
  drive.pairs[3].cam2_from_cam1.rotation = Step(40).rotation;
  drive.pairs[4].cam2_from_cam1.rotation = Step(40).rotation;
  drive.motions[3].cam2_from_cam1 = Step(59);
  drive.motions[4].cam2_from_cam1 = Step(61);
  LeaveOutContradicted(drive.pairs, &drive.motions);
  ASSERT_EQ(drive.motions.size(), 9u);
  EXPECT_EQ(drive.motions[4].image1, 5);
}

TEST(LeaveOutContradicted, FewMatchesOrAnotherPoseOfAPlaneContradictNothing) {
  Drive drive = MakeDrive();
  drive.motions[3].cam2_from_cam1 = Step(30);
  drive.motions[4].cam2_from_cam1 = Step(30);
  drive.pairs[3] = PairOf(3, Step(4), 49);
  drive.pairs[4].alternatives = {Step(29)};
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 10u);
}

TEST(LeaveOutContradicted, AWayOfManyStepsIsAJump) {
  Drive drive = MakeDrive();
  drive.motions[2].cam2_from_cam1 = Step(4, 9.9);
  drive.motions[7].cam2_from_cam1 = Step(4, 10.1);
  LeaveOutContradicted({}, &drive.motions);
  ASSERT_EQ(drive.motions.size(), 9u);
  EXPECT_EQ(drive.motions[7].image1, 8);
}

TEST(LeaveOutContradicted, OdometryThatMostlyTurnsOtherwiseIsAllLeftOut) {
  Drive drive = MakeDrive();
  for (int i = 0; i < 5; ++i) drive.motions[i].cam2_from_cam1 = Step(20);
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");  // half, and they are left out
  EXPECT_EQ(drive.motions.size(), 5u);
  drive = MakeDrive();
  for (int i = 0; i < 6; ++i) drive.motions[i].cam2_from_cam1 = Step(20);
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions),
            "on 6 of 10 steps the camera turned otherwise than the odometry says");
  EXPECT_TRUE(drive.motions.empty());
  // Four steps are too few to say so.
  drive = MakeDrive();
  drive.pairs.resize(4);
  for (int i = 0; i < 4; ++i) drive.motions[i].cam2_from_cam1 = Step(20);
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 6u);
}

// Poses of the robot's body instead of the camera: x is ahead.
TEST(LeaveOutContradicted, OdometryThatGoesElsewhereIsAllLeftOut) {
  Drive drive = MakeDrive();
  for (ImageMotion& motion : drive.motions) motion.cam2_from_cam1 = {{1, 0, 0, 0}, {-1, 0, 0}};
  EXPECT_THAT(LeaveOutContradicted(drive.pairs, &drive.motions),
              HasSubstr("another direction than the odometry says, by 86 degrees"));
  EXPECT_TRUE(drive.motions.empty());
  // Less than half as much is what a pair's direction is worth.
  drive = MakeDrive();
  const Eigen::Quaterniond askew(Eigen::AngleAxisd(RadFromDeg(40), Eigen::Vector3d::UnitX()));
  for (ImageMotion& motion : drive.motions)
    motion.cam2_from_cam1.translation = askew * motion.cam2_from_cam1.translation;
  EXPECT_EQ(LeaveOutContradicted(drive.pairs, &drive.motions), "");
  EXPECT_EQ(drive.motions.size(), 10u);
}

TEST(PairsOf, WeighLessThanPairsThatShareMuch) {
  const std::vector<ViewPair> pairs = PairsOf({{2, 3, Step(4)}});
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].image1, 2);
  EXPECT_EQ(pairs[0].image2, 3);
  EXPECT_TRUE(pairs[0].matches.empty());
  EXPECT_EQ(RotationErrorDeg(pairs[0].cam2_from_cam1, Step(4)), 0);
  EXPECT_GT(pairs[0].weight, 0);
  EXPECT_LT(pairs[0].weight, 0.5);
}

}  // namespace
}  // namespace cairn::reconstruct
