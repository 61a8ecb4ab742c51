#include "stages/group_classes/adjust/parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Parts, OnlyASurveyThatIsTooLargeAtOnceIsCut) {
  EXPECT_THAT(NumPartsOfRounds(600, 600), IsEmpty());
  // 4 of 150 images, at most 200; before them 8 of 75, and 16 of 37, at most 50.
  EXPECT_THAT(NumPartsOfRounds(601, 600), ElementsAre(16, 8, 4));
  EXPECT_THAT(NumPartsOfRounds(800, 600), ElementsAre(16, 8, 4));  // 200 and 50 images, just
  EXPECT_THAT(NumPartsOfRounds(10000, 600), ElementsAre(256, 128, 64));
  EXPECT_THAT(NumPartsOfRounds(24, 20), ElementsAre(8, 4));  // no part is smaller than is worth it
  EXPECT_THAT(NumPartsOfRounds(40, 10), ElementsAre(16));
}

TEST(Parts, BeginWhereTwoOfTheRoundBeforeMeet) {
  EXPECT_THAT(BeginsOfParts(10, 4), ElementsAre(0, 2, 5, 7, 10));
  EXPECT_THAT(BeginsOfParts(10, 2), ElementsAre(0, 5, 10));
  EXPECT_EQ(BeginsOfParts(2000000, 4096).back(), 2000000);
}

TEST(Parts, SeeOfATrackWhatTwoOfTheirImagesSee) {
  //  images   0 1 | 2 3 4
  //  track 0  #   | #   #
  //  track 1  # # |   #
  const std::vector<Track> tracks = {{{0, 7}, {2, 8}, {4, 9}}, {{0, 5}, {1, 6}, {3, 4}}};
  const std::vector<std::vector<Track>> parts = SplitTracks(tracks, {0, 2, 5});
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_THAT(parts[0], ElementsAre(Track{{0, 5}, {1, 6}}));
  EXPECT_THAT(parts[1], ElementsAre(Track{{0, 8}, {2, 9}}));
}

// Cameras look up, on the floor: x to the right.
Pose At(double x, double y, double turn_deg = 0) {
  Pose pose;
  pose.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(turn_deg), Eigen::Vector3d::UnitZ())).conjugate();
  pose.translation = -(pose.rotation * Eigen::Vector3d(x, y, 0));
  return pose;
}

TEST(Parts, WhatFollowsABendMovesAlong) {
  //  before:  0 1 2 3      the first part bends by a right angle:   3
  //                                                                 2
  //                                                                 |
  //                                                               0 1
  const std::vector<Pose> before = {At(0, 0), At(1, 0), At(2, 0), At(3, 0)};
  // The second part bends nowhere, and each pose has an error of its own: 0.5 to its left.
  const PosesOfPart first = {{At(0, 0.5), At(1, 0.5, 90)}, {At(0, 0), At(1, 0, 90)}};
  const PosesOfPart second = {{At(2, 0.5), At(3, 0.5)}, {At(2, 0), At(3, 0)}};
  const PosesOfPart whole = JoinParts({first, second}, before);
  ASSERT_EQ(whole.poses.size(), 4u);
  const std::vector<Pose> drifted = {At(0, 0), At(1, 0, 90), At(1, 1, 90), At(1, 2, 90)};
  const std::vector<Pose> poses = {At(0, 0.5), At(1, 0.5, 90), At(0.5, 1, 90), At(0.5, 2, 90)};
  for (int i = 0; i < 4; ++i) {
    EXPECT_LT(CenterErrorM(whole.drifted[i], drifted[i]), 1e-12) << i;
    EXPECT_LT(RotationErrorDeg(whole.drifted[i], drifted[i]), 1e-5) << i;
    EXPECT_LT(CenterErrorM(whole.poses[i], poses[i]), 1e-12) << i;
    EXPECT_LT(RotationErrorDeg(whole.poses[i], poses[i]), 1e-5) << i;
  }
}

}  // namespace
}  // namespace cairn::group_classes
