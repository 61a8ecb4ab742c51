#include "stages/group_classes/tracks/sub_survey.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;

// `num_images` of each camera in turn; each has moved by as many metres as its number.
PosedImages Drive(int num_images, int num_cameras) {
  PosedImages posed;
  posed.cameras.resize(num_cameras);
  for (int i = 0; i < num_images; ++i) {
    posed.feature_idx.push_back(100 + i);
    posed.camera_idx.push_back(i % num_cameras);
    posed.stated.push_back({Eigen::Quaterniond::Identity(), {1.0 * i, 0, 0}});
    posed.poses.push_back({Eigen::Quaterniond::Identity(), {0, 2.0 * i, 0}});
    posed.way_m.push_back(i);
  }
  posed.camera_from_given.translation.z() = 7;
  return posed;
}

TEST(SelectImages, WhatLiesBetweenWasDrivenToo) {
  const PosedImages selected = SelectImages(Drive(8, 2), {1, 2, 6});
  EXPECT_THAT(selected.way_m, ElementsAre(0, 2, 3 + 4 + 5 + 6));
  EXPECT_THAT(selected.feature_idx, ElementsAre(101, 102, 106));
  EXPECT_THAT(selected.camera_idx, ElementsAre(1, 0, 0));
  EXPECT_EQ(selected.cameras.size(), 2u);
  EXPECT_EQ(selected.stated[2].translation.x(), 6);
  EXPECT_EQ(selected.poses[2].translation.y(), 12);
  EXPECT_EQ(selected.camera_from_given.translation.z(), 7);
}

TEST(Restrict, ATrackNeedsTwoOfTheImages) {
  const std::vector<Track> tracks = {{{0, 10}, {1, 11}, {3, 12}}, {{0, 20}, {2, 21}}, {{1, 30}, {3, 31}}};
  const SubSurvey sub = Restrict(Drive(4, 1), tracks, {1, 3});
  ASSERT_EQ(sub.tracks.size(), 2u);
  ASSERT_EQ(sub.tracks[0].size(), 2u);
  EXPECT_EQ(sub.tracks[0][0].image_idx, 0);
  EXPECT_EQ(sub.tracks[0][0].keypoint_idx, 11);
  EXPECT_EQ(sub.tracks[0][1].image_idx, 1);
  EXPECT_EQ(sub.tracks[0][1].keypoint_idx, 12);
  EXPECT_EQ(sub.tracks[1][1].keypoint_idx, 31);
}

std::vector<int> Range(int begin, int end) {
  std::vector<int> range;
  for (int i = begin; i < end; ++i) range.push_back(i);
  return range;
}

TEST(ImagesToLearnFrom, AreAllOfAFewAndTwoRunsOfMany) {
  EXPECT_EQ(ImagesToLearnFrom(Drive(40, 1), 40), Range(0, 40));
  std::vector<int> runs = Range(15, 35);
  for (const int i : Range(65, 85)) runs.push_back(i);
  EXPECT_EQ(ImagesToLearnFrom(Drive(100, 1), 40), runs);
}

// However few are asked for, 24 of each camera, where it has as many.
TEST(ImagesToLearnFrom, EachCameraHasEnough) {
  PosedImages drive = Drive(120, 2);
  const std::vector<int> both = ImagesToLearnFrom(drive, 10);
  EXPECT_EQ(both.size(), 48u);
  EXPECT_EQ(std::count_if(both.begin(), both.end(), [](int i) { return i % 2 == 0; }), 24);
  // A camera without images takes nothing from the others.
  drive.cameras.resize(3);
  EXPECT_EQ(ImagesToLearnFrom(drive, 100).size(), 100u);
}

}  // namespace
}  // namespace cairn::group_classes
