#include "sim/survey/drive_way.h"

#include <gtest/gtest.h>

namespace cairn::sim {
namespace {

TEST(DriveWay, LeavesOutNoTwoInARow) {
  DriveWay way({7, 8, 9, 10});
  ASSERT_TRUE(way.MayLeaveOut());
  way.LeaveOut();
  EXPECT_EQ(way.next(), 1);
  EXPECT_FALSE(way.MayLeaveOut());
  way.Arrive();
  EXPECT_EQ(way.next(), 2);
  EXPECT_TRUE(way.MayLeaveOut());
  way.Arrive();
  EXPECT_FALSE(way.LeadsToGoal());
  way.LeaveOut();
  EXPECT_TRUE(way.LeadsToGoal());
}

TEST(DriveWay, WhatWasLeftOutOfOneWayCountsForNoOther) {
  DriveWay way({7, 8});
  way.LeaveOut();
  way = DriveWay({8, 9});
  EXPECT_TRUE(way.MayLeaveOut());
  way.LeaveOut();
  way.BeginAt(1);
  EXPECT_TRUE(way.MayLeaveOut());
}

}  // namespace
}  // namespace cairn::sim
