#include "runtime/scans/scan_segments.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "runtime/scans/carmen_log.h"
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

std::vector<RangeScan> Scans(const std::string& log) {
  auto scans = ParseCarmenLog(log, "log");
  EXPECT_TRUE(scans.ok());
  return scans.ok() ? std::move(*scans) : std::vector<RangeScan>();
}

void ExpectOdometry(const RangeScan& scan, double x, double y, double heading_rad) {
  ASSERT_TRUE(scan.odometry);
  EXPECT_NEAR(scan.odometry->position.x(), x, 1e-12);
  EXPECT_NEAR(scan.odometry->position.y(), y, 1e-12);
  EXPECT_NEAR(scan.odometry->heading_rad, heading_rad, 1e-12);
}

TEST(CarmenLog, ScansThatSayWhatTheWheelsSayHaveTheirOdometry) {
  const auto scans =
      Scans("ODOM 5 5 0 0 0 0 1 h 1\nFLASER 1 2 10 20 0.5 9 19 0.4 1 h 1\nFLASER 1 2 1 2 3 1 2 3 2 h 2\n");
  ASSERT_EQ(scans.size(), 2u);
  ExpectOdometry(scans[0], 9, 19, 0.4);
  ExpectOdometry(scans[1], 1, 2, 3);
}

TEST(CarmenLog, OdometryAtAScansTimeIsBetweenTheMessagesAroundIt) {
  const std::string scan = "FLASER 1 2 7 8 0.5 7 8 0.5 ";
  const auto scans = Scans(scan + "0.5 h 1\nODOM 1 2 3.1 0 0 0 1 h 1\n" + scan + "2 h 2\n" + scan +
                           "9 h 2\nODOM 5 10 -3.1 0 0 0 5 h 5\n" + scan + "6 h 6\n");
  ASSERT_EQ(scans.size(), 4u);
  ExpectOdometry(scans[0], 1, 2, 3.1);  // before the first: as there
  ExpectOdometry(scans[1], 2, 4, WrapAngle(3.1 + 0.25 * (2 * std::numbers::pi - 6.2)));
  ExpectOdometry(scans[2], 5, 10, -3.1);  // a clock that is ahead
  ExpectOdometry(scans[3], 5, 10, -3.1);
  ExpectOdometry(Scans(scan + "1 h 1\n")[0], 7, 8, 0.5);  // without any message: its pose
}

// As the logs of gridded SLAM are written: ODOM without a time states the corrected pose of the scan before.
TEST(CarmenLog, CorrectionsOfPosesMoveNothing) {
  const std::string scan = "FLASER 1 2 7 8 0 7 8 0 ";
  const auto scans =
      Scans("ODOM 0 0 0 0 0 0 1 h 1\nODOM 1 0 0 0 0 0 2 h 2\n" + scan +
            "2 h 2\nODOM 7 8 1.5707963267948966 0 0 0 0 h 0\nODOM 7 10 1.5707963267948966 0 0 0 3 h 3\n" +
            scan + "3 h 3\n");
  ASSERT_EQ(scans.size(), 2u);
  ExpectOdometry(scans[0], 1, 0, 0);
  ExpectOdometry(scans[1], 3, 0, 0);  // two metres ahead
}

TEST(CarmenLog, SeveralCorrectionsMoveNothingEither) {
  const std::string scan = "FLASER 1 2 7 8 0 7 8 0 ";
  const auto scans = Scans("ODOM 0 0 0 0 0 0 5 h 5\nODOM 3 0 0 0 0 0 0 h 0\nODOM 9 9 0 0 0 0 0 h 0\n" + scan +
                           "6 h 6\nODOM 10 9 0 0 0 0 7 h 7\n" + scan + "7 h 7\n");
  ASSERT_EQ(scans.size(), 2u);
  ExpectOdometry(scans[0], 0.5, 0, 0);  // half way from 5 s to 7 s
  ExpectOdometry(scans[1], 1, 0, 0);
}

TEST(CarmenLog, WheelsMoveTheLaserThatStandsAheadOfThem) {
  const std::string log = "ODOM 1 2 1.5707963267948966 0 0 0 1 h 1\nFLASER 1 2 7 8 0 7 8 0 1 h 1\n";
  ExpectOdometry(Scans("PARAM robot_frontlaser_offset 0.5 h 0\n" + log)[0], 1, 2.5, std::numbers::pi / 2);
  ExpectOdometry(Scans(log)[0], 1, 2, std::numbers::pi / 2);
  // Without times, or an acceleration.
  ExpectOdometry(Scans("ODOM 1 2 3\nFLASER 1 2 7 8 0 7 8 0 1 h 1\n")[0], 1, 2, 3);
  ExpectOdometry(Scans("ODOM 1 2 3 0 0 4 h 4\nFLASER 1 2 7 8 0 7 8 0 5 h 5\nODOM 2 2 3 0 0 6 h 6\n")[0], 1.5,
                 2, 3);
}

std::string RobotLaser(const std::string& beams, const std::string& after) {
  return "ROBOTLASER1 4 -1.2 2.4 0.02 30 0.01 0 " + beams + " " + after + "\n";
}

TEST(CarmenLog, ScansOfAnyAngleAreRead) {
  const std::string after = "1 2 0.5 0.9 1.9 0.5 0 0 0 0 0 7.25 host 7.5";
  const auto scans = Scans(RobotLaser("3 1 2.5 30 2 10 11", after) + RobotLaser("1 4 0", after));
  ASSERT_EQ(scans.size(), 2u);
  EXPECT_THAT(scans[0].ranges_m, testing::ElementsAre(1, 2.5, 30));
  EXPECT_EQ(scans[0].first_angle_rad, -1.2);
  EXPECT_EQ(scans[0].step_rad, 0.02);
  EXPECT_EQ(scans[0].max_range_m, 30);
  EXPECT_EQ(scans[0].pose.position, Vec2(1, 2));
  EXPECT_EQ(scans[0].pose.heading_rad, 0.5);
  EXPECT_EQ(scans[0].time_s, 7.25);
  ExpectOdometry(scans[0], 1, 2, 0.5);
  EXPECT_THAT(scans[1].ranges_m, testing::ElementsAre(4));
  for (const std::string& line :
       {RobotLaser("0 0", after), RobotLaser("3 1 2 3", after), RobotLaser("1 4 -1", after),
        RobotLaser("1 x 0", after), "ROBOTLASER1 4 -1.2 2.4 1e308 30 0.01 0 1 4 0 " + after + "\n",
        RobotLaser("1 4 0", "1 2 0.5"), RobotLaser("100001 4 0", after),
        RobotLaser("1 4 0", "1 nan 0.5 0.9 1.9 0.5 0 0 0 0 0 7.25 host 7.5"),
        std::string("ROBOTLASER1 4 -1.2 2.4\n")}) {
    const auto refused = ParseCarmenLog(line, "log");
    ASSERT_FALSE(refused.ok()) << line;
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt) << line;
    EXPECT_THAT(refused.error().message, HasSubstr("log: line 1: ")) << line;
  }
}

TEST(CarmenLog, RefusesLinesThatAreCutShort) {
  EXPECT_EQ(ParseCarmenLog("FLASER 4 1 2 3\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("FLASER 1 x 0 0 0 0 0 0 1 h 1\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("FLASER 999999999 1\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParseCarmenLog("PARAM a b\n", "log").error().code, ErrorCode::kNoData);
  EXPECT_EQ(ParseCarmenLog("ODOM 1\n", "log").error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(ParseCarmenLog("\nODOM 1 2 x 0 0 0 1 h 1\n", "log").error().message,
              HasSubstr("log: line 2: \"x\""));
  EXPECT_EQ(ParseCarmenLog("PARAM robot_frontlaser_offset \n", "log").error().code, ErrorCode::kCorrupt);
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
