#include "runtime/scans/scan_segments.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "runtime/scans/read_scans.h"

namespace cairn {
namespace {

using testing::HasSubstr;
using Vec2 = Eigen::Vector2d;

// What a laser in the middle of walls measures; beams that meet nothing have the range 80.
RangeScan Measure(const std::vector<std::pair<Vec2, Vec2>>& walls, double sigma, uint64_t seed) {
  RangeScan scan{.first_angle_rad = -std::numbers::pi / 2, .step_rad = std::numbers::pi / 360};
  Random random(seed);
  for (int i = 0; i < 360; ++i) {
    const double angle = scan.first_angle_rad + i * scan.step_rad;
    const Vec2 ray(std::cos(angle), std::sin(angle));
    double range = 80;
    for (const auto& [a, b] : walls) {
      const double side_a = ray.x() * a.y() - ray.y() * a.x(), side_b = ray.x() * b.y() - ray.y() * b.x();
      if ((side_a > 0) == (side_b > 0)) continue;
      const double distance = (a + (b - a) * (side_a / (side_a - side_b))).dot(ray);
      if (distance > 0) range = std::min(range, distance);
    }
    scan.ranges_m.push_back(range < 80 ? range + random.Normal(0, sigma) : range);
  }
  return scan;
}

TEST(ScanSegments, ACornerHasTwoWallsAndTheDoorBetweenDividesOne) {
  //   +------      The wall ahead from (3, -2) to (3, 2) with a door of one metre,
  //   |            the wall to the left at y = 2.
  const auto segments =
      FindScanSegments(Measure({{{3, -2}, {3, 0}}, {{3, 1}, {3, 2}}, {{3, 2}, {-1, 2}}}, 0, 0), {});
  ASSERT_EQ(segments.size(), 3u);
  EXPECT_NEAR(segments[0].Angle(), std::numbers::pi / 2, 1e-6);
  EXPECT_NEAR(segments[0].start.x(), 3, 1e-6);
  EXPECT_NEAR(segments[0].Length(), 2, 0.06);
  EXPECT_NEAR(segments[1].Length(), 1, 0.06);
  EXPECT_NEAR(std::abs(segments[2].Angle()), std::numbers::pi, 1e-6);
  EXPECT_NEAR(segments[2].start.y(), 2, 1e-6);
}

TEST(ScanSegments, NothingStraightIsNoSegment) {
  RangeScan scan{.first_angle_rad = 0, .step_rad = 0.01};
  EXPECT_TRUE(FindScanSegments(scan, {}).empty());
  scan.ranges_m = {5};
  EXPECT_TRUE(FindScanSegments(scan, {}).empty());
  scan.ranges_m.assign(300, 81.9);
  EXPECT_TRUE(FindScanSegments(scan, {}).empty());
  Random random(1);
  for (double& range : scan.ranges_m) range = random.Uniform(1, 10);
  EXPECT_TRUE(FindScanSegments(scan, {}).empty());
}

TEST(ScanSegments, StandardDeviationsAreThoseOfTheFit) {
  double angle = 0, offset = 0;
  const int num = 400;
  ScanSegment segment;
  for (int seed = 0; seed < num; ++seed) {
    const auto segments =
        FindScanSegments(Measure({{{3, -2}, {3, 2}}}, 0.02, seed), {.sigma_range_m = 0.02, .split_m = 0.2});
    ASSERT_EQ(segments.size(), 1u);
    segment = segments[0];
    angle += std::pow(segment.Angle() - std::numbers::pi / 2, 2) / num;
    offset += std::pow(segment.Middle().x() - 3, 2) / num;
  }
  EXPECT_NEAR(std::sqrt(angle) / segment.sigma_angle_rad, 1, 0.3);
  EXPECT_NEAR(std::sqrt(offset) / segment.sigma_offset_m, 1, 0.3);
}

TEST(CarmenLog, ReadsBeamsPoseAndTime) {
  const auto scans = ParseCarmenLog(
      "# a comment\nODOM 0 0 0 0 0 0 0.1 h 0.1\nFLASER 4 1 2 3 81.91 10 20 0.5 9 19 0.4 7.25 host 7.5\n",
      "log");
  ASSERT_TRUE(scans.ok());
  ASSERT_EQ(scans->size(), 1u);
  EXPECT_THAT((*scans)[0].ranges_m, testing::ElementsAre(1, 2, 3, 81.91));
  EXPECT_DOUBLE_EQ((*scans)[0].step_rad, std::numbers::pi / 4);
  EXPECT_EQ((*scans)[0].pose.position, Vec2(10, 20));
  EXPECT_EQ((*scans)[0].pose.heading_rad, 0.5);
  EXPECT_EQ((*scans)[0].time_s, 7.25);
}

TEST(CarmenLog, RefusesLinesThatAreCutShort) {
  EXPECT_EQ(ParseCarmenLog("FLASER 4 1 2 3\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("FLASER 1 x 0 0 0 0 0 0 1 h 1\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("FLASER 999999999 1\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("ODOM 1\n", "log").error().code, ErrorCode::kNoData);
  EXPECT_THAT(ParseCarmenLog("\x1f\x8b\x08", "log").error().message, HasSubstr("gunzip"));
}

TEST(ReadScans, SegmentsAreTurnedSoThatTheRobotSeesThem) {
  const auto scans = ParseScans("2,1,2,-1\n# comment\n-1,3,-2,3,0.5,0.01\n", "scan", {});
  ASSERT_TRUE(scans.ok());
  ASSERT_EQ(scans->size(), 1u);
  EXPECT_EQ((*scans)[0].segments[0].start, Vec2(2, -1));
  EXPECT_EQ((*scans)[0].segments[1].start, Vec2(-1, 3));
  EXPECT_NEAR((*scans)[0].segments[1].sigma_angle_rad, 0.5 * std::numbers::pi / 180, 1e-12);
  EXPECT_EQ(ParseScans("1,1,2,2\n", "scan", {}).error().code, ErrorCode::kCorrupt);
  for (const char* line : {"1,1,2", "1,nan,2,2", "1,1,2,1e300", "1,1,2,3,0,0.01", "1,1,2,3,0.5,-1"}) {
    const auto refused = ParseScans(line, "scan", {});
    ASSERT_FALSE(refused.ok()) << line;
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(refused.error().message, HasSubstr("scan: line 1: "));
  }
  EXPECT_EQ(ParseScans("\n", "scan", {}).error().code, ErrorCode::kNoData);
}

}  // namespace
}  // namespace cairn
