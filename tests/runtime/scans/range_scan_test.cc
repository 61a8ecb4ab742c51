#include "runtime/scans/range_scan.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/scans/beam.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {
namespace {

using testing::HasSubstr;

// Four metres wide, seen from its middle: a wall at x = 3.
RangeScan AWall() {
  RangeScan scan;
  scan.first_angle_rad = -0.6;
  scan.step_rad = 0.01;
  for (size_t i = 0; i <= 120; ++i) scan.ranges_m.push_back(3 / std::cos(scan.AngleOf(i)));
  return scan;
}

// The same beams, with their angles one by one.
RangeScan Stated(const RangeScan& scan) {
  RangeScan stated;
  stated.ranges_m = scan.ranges_m;
  stated.max_range_m = scan.max_range_m;
  for (size_t i = 0; i < scan.ranges_m.size(); ++i) stated.angles_rad.push_back(scan.AngleOf(i));
  return stated;
}

TEST(RangeScan, AnglesMayBeStatedOneByOne) {
  const RangeScan equal = AWall(), stated = Stated(equal);
  ASSERT_TRUE(CheckRangeScan(stated).ok());
  const auto beams = BeamsOf(equal, 20), same = BeamsOf(stated, 20);
  ASSERT_EQ(beams.size(), 121u);
  ASSERT_EQ(same.size(), 121u);
  for (size_t i = 0; i < beams.size(); ++i) EXPECT_EQ(beams[i].End(), same[i].End());
  EXPECT_NEAR(same[0].End().x(), 3, 1e-9);
  const auto segments = FindScanSegments(stated, {});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_NEAR(segments[0].start.x(), 3, 1e-9);
  EXPECT_NEAR(segments[0].start.y(), -3 * std::tan(0.6), 1e-9);
  EXPECT_EQ(segments[0].num_points, 121);
}

// Where a turn is cut, angles jump by a turn, and beams are neighbours.
TEST(RangeScan, AWallBehindIsOneSegment) {
  RangeScan scan = Stated(AWall());
  for (double& angle : scan.angles_rad) angle = WrapAngle(angle + std::numbers::pi);
  ASSERT_TRUE(CheckRangeScan(scan).ok());
  const auto segments = FindScanSegments(scan, {});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_NEAR(segments[0].start.x(), -3, 1e-9);
}

TEST(RangeScan, WhatCannotBeIsRefused) {
  const auto refused = [](const RangeScan& scan) {
    const Status status = CheckRangeScan(scan);
    EXPECT_FALSE(status.ok());
    if (status.ok()) return std::string();
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    return status.error().message;
  };
  EXPECT_THAT(refused({}), HasSubstr("0 beams"));
  RangeScan scan = AWall();
  scan.ranges_m.resize(kMaxBeams + 1);
  scan.step_rad = 1e-6;
  EXPECT_THAT(refused(scan), HasSubstr("100001 beams"));
  scan.ranges_m.resize(kMaxBeams);
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  scan = Stated(AWall());
  scan.angles_rad.pop_back();
  EXPECT_THAT(refused(scan), HasSubstr("121 ranges and 120 angles"));
  scan = Stated(AWall());
  scan.angles_rad[7] = NAN;
  EXPECT_THAT(refused(scan), HasSubstr("beam 7"));
  scan = AWall();
  scan.first_angle_rad = INFINITY;
  EXPECT_THAT(refused(scan), HasSubstr("beam 0"));
  scan = AWall();
  scan.step_rad = 0;
  EXPECT_THAT(refused(scan), HasSubstr("all 121 beams of a scan look at -0.6 rad"));
  scan.step_rad = 0.5;
  EXPECT_THAT(refused(scan), HasSubstr("are the angles degrees?"));
  scan.step_rad = -0.05;  // clockwise, a turn less a little
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  scan.step_rad = 2 * std::numbers::pi / 120;  // the first beam twice
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  for (const double most : {0.0, -1.0, static_cast<double>(NAN)}) {
    scan = AWall();
    scan.max_range_m = most;
    EXPECT_THAT(refused(scan), HasSubstr("largest range"));
  }
  // Ranges may be anything, and one beam is a scan.
  scan = AWall();
  scan.ranges_m = {NAN};
  EXPECT_TRUE(CheckRangeScan(scan).ok());
}

TEST(RangeScan, BeamsSweepATurnAndALittleAtMost) {
  RangeScan scan = AWall();
  scan.step_rad = 1.005 * 2 * std::numbers::pi / 120;
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  scan.step_rad = 1.02 * 2 * std::numbers::pi / 120;
  EXPECT_FALSE(CheckRangeScan(scan).ok());
  scan.step_rad = 0.01;
  scan.max_range_m = 0.5;
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  // Two beams look two ways.
  scan = AWall();
  scan.ranges_m = {1, 2};
  EXPECT_TRUE(CheckRangeScan(scan).ok());
  scan.step_rad = 0;
  EXPECT_FALSE(CheckRangeScan(scan).ok());
}

}  // namespace
}  // namespace cairn
