#include "runtime/drive/sure_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/option_limits.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

SureTracker MakeSure(const SureTrackerOptions& options) {
  return *SureTracker::Make(RoomMap(), {}, {}, options);
}

Localization Show(SureTracker* tracker, const Pose& pose, int frame) {
  return *tracker->TrackFeatures(RenderFeatures(Room(), pose, {}, 500 + frame), Room().camera);
}

TEST(SureTracker, WithoutAProbabilityItIsARegionTracker) {
  SureTracker every = MakeSure({});
  RegionTracker plain(RoomMap());
  EXPECT_FALSE(every.belief());
  for (int i = 0; i < 3; ++i) {
    const Localization found = Show(&every, OnDrive(i), i);
    const Localization expected =
        *plain.TrackFeatures(RenderFeatures(Room(), OnDrive(i), {}, 500 + i), Room().camera);
    ASSERT_TRUE(found.has_fix());
    EXPECT_EQ(found.cam_from_world.translation, expected.cam_from_world.translation);
    EXPECT_EQ(found.probability, expected.probability);
  }
  EXPECT_TRUE(every.Move({1, 0}, 0).ok());
  EXPECT_TRUE(every.SenseUp({0, -1, 0}, 1).ok());
  const Status status = every.Elapse(1);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, testing::HasSubstr("min_place_probability"));
}

TEST(SureTracker, OdometryMovesItsTrackerAndItsBelief) {
  for (const double min_place_probability : {0.0, 0.9}) {
    SureTracker over_floor = MakeSure({.min_place_probability = min_place_probability});
    SureTracker in_space = over_floor;
    ASSERT_TRUE(Show(&over_floor, OnDrive(0), 0).has_fix());
    ASSERT_TRUE(Show(&in_space, OnDrive(0), 0).has_fix());
    const Pose motion = OnDrive(20) * OnDrive(0).Inverse();
    const FloorMotion on_floor = OverFloor(motion);
    ASSERT_TRUE(over_floor.Move(on_floor.way_m, on_floor.turn_left_rad).ok());
    ASSERT_TRUE(in_space.Move({motion, 1e-4 * Matrix6d::Identity()}).ok());
    for (SureTracker* tracker : {&over_floor, &in_space}) {
      EXPECT_LT(CenterErrorM(tracker->Believed()->pose, OnDrive(20)), 0.05);
      const Localization found = Show(tracker, OnDrive(20), 20);
      EXPECT_TRUE(found.has_fix());
      EXPECT_EQ(found.scope, Scope::kTrack);
    }
    if (!over_floor.belief()) continue;
    for (size_t i = 0; i < over_floor.belief()->probabilities().size(); ++i)
      EXPECT_NEAR(over_floor.belief()->probabilities()[i], in_space.belief()->probabilities()[i], 1e-6);
  }
}

TEST(SureTracker, OptionsOfABeliefThatNobodyAskedForAreRefused) {
  const auto error_of = [](const SureTrackerOptions& options) {
    const auto tracker = SureTracker::Make(RoomMap(), {}, {}, options);
    return tracker.ok() ? "" : tracker.error().message;
  };
  EXPECT_THAT(
      error_of({.belief = {.fix_ratio = 0.7}}),
      testing::AllOf(testing::HasSubstr("place_fix_ratio"), testing::HasSubstr("min_place_probability")));
  EXPECT_THAT(error_of({.look_anew_s = 2}), testing::HasSubstr("look_anew_s"));
  EXPECT_EQ(error_of({.min_place_probability = 0.5, .look_anew_s = 2, .belief = {.fix_ratio = 0.7}}), "");
}

TEST(SureTracker, AFixIsPublishedWhenItsPlaceIsSure) {
  // Nine of ten times it wakes up elsewhere, and one fix has odds of 100: 11 to 1.  The drive shows more.
  SureTracker tracker = MakeSure({.min_place_probability = 0.95, .belief = {.elsewhere_ratio = 0.9}});
  const Localization first = Show(&tracker, OnDrive(0), 0);
  EXPECT_EQ(first.reason, NoFix::kImprobable);
  EXPECT_NEAR(first.probability, 0.99 * 100 / 109, 0.03);
  EXPECT_THAT(first.message, testing::HasSubstr("0.95 is needed"));
  int first_published = -1;
  for (int i = 1; i < 12; ++i) {
    const Localization found = Show(&tracker, OnDrive(i), i);
    if (!found.has_fix()) continue;
    if (first_published < 0) first_published = i;
    EXPECT_GE(found.probability, 0.95);
    EXPECT_LT(CenterErrorM(found.cam_from_world, OnDrive(i)), 0.05);
  }
  EXPECT_GT(first_published, 0);
  // At once, where less is asked for.
  SureTracker bold = MakeSure({.min_place_probability = 0.9});
  EXPECT_TRUE(Show(&bold, OnDrive(0), 0).has_fix());
}

TEST(SureTracker, WhileItIsSureFramesAreLookedAtAnewBySeconds) {
  SureTracker tracker = MakeSure({.min_place_probability = 0.9, .look_anew_s = 1});
  std::vector<double> probabilities;
  for (int i = 0; i < 25; ++i) {
    ASSERT_TRUE(tracker.Elapse(0.1).ok());
    const Localization found = Show(&tracker, OnDrive(i), i);
    ASSERT_TRUE(found.has_fix()) << i << ": " << found.message;
    EXPECT_EQ(found.scope == Scope::kTrack, i > 0) << i;
    probabilities.push_back(found.probability);
  }
  // Between looks it is as sure as at the last.
  EXPECT_EQ(probabilities[9], probabilities[1]);
  EXPECT_NE(probabilities[12], probabilities[9]);
  EXPECT_EQ(probabilities[19], probabilities[12]);
}

TEST(SureTracker, WhatGravityContradictsIsNotPublished) {
  SureTracker upright = MakeSure({.min_place_probability = 0.9}),
              tilted = MakeSure({.min_place_probability = 0.9});
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(upright.SenseUp({0, -1, 0}, 2).ok());
    EXPECT_TRUE(Show(&upright, OnDrive(i), i).has_fix());
    ASSERT_TRUE(tilted.SenseUp({0.7, -0.7, 0}, 2).ok());
    EXPECT_FALSE(Show(&tilted, OnDrive(i), i).has_fix());
  }
  EXPECT_GT(tilted.belief()->elsewhere(), 0.7);
  EXPECT_FALSE(tilted.SenseUp({0, 0, 0}, 2).ok());
}

TEST(SureTracker, ACarriedRobotIsPublishedAgainWhenItIsSure) {
  SureTracker tracker = MakeSure({.min_place_probability = 0.9});
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(Show(&tracker, OnDrive(i), i).has_fix());
  const auto [opposite, num_withheld] = [&] {
    int withheld = 0;
    for (int i = 60; i < 70; ++i) {
      const Localization found = Show(&tracker, OnDrive(i), i);
      if (found.has_fix()) return std::pair(found.cam_from_world, withheld);
      ++withheld;
    }
    return std::pair(Pose(), withheld);
  }();
  EXPECT_LT(num_withheld, 8);
  EXPECT_LT(CenterErrorM(opposite, OnDrive(60 + num_withheld)), 0.05);
}

TEST(SureTracker, RefusesWhatCannotBe) {
  EXPECT_EQ(SureTracker::Make(RoomMap(), {}, {}, {.min_place_probability = 1}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(SureTracker::Make(RoomMap(), {}, {}, {.look_anew_s = -1}).error().code,
            ErrorCode::kInvalidArgument);
  MapRows empty;
  empty.name = "empty";
  const auto map = *Map::FromRows(empty);
  EXPECT_EQ(SureTracker::Make(map, {}, {}, {.min_place_probability = 0.9}).error().code, ErrorCode::kNoData);
  EXPECT_TRUE(SureTracker::Make(map, {}, {}, {}).ok());
}

TEST(SureTracker, OptionsHaveTheirRanges) {
  ExpectLimits<SureTrackerOptions>({{"min_place_probability", "0", "-0.001", "0.999999999", "0.9999999995"},
                                    {"look_anew_s", "0", "-0.001"},
                                    {"place_leave_ratio", "1e-9", "9e-10", "0.999999999", "0.9999999995"}});
}

}  // namespace
}  // namespace cairn
