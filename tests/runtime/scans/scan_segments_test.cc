#include "runtime/scans/scan_segments.h"

#include <cmath>
#include <numbers>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/pose.h"
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

// By hand: scatter 2 along the line and 0.06 across it, of three points.
TEST(ScanSegments, ALineIsFittedToThreePoints) {
  const std::vector<Vec2> points = {{4, 5}, {3, 5.3}, {2, 5}};
  const ScanSegment line = FitSegment(points, 0.01);
  EXPECT_NEAR((line.start - Vec2(4, 5.1)).norm(), 0, 1e-12);
  EXPECT_NEAR((line.end - Vec2(2, 5.1)).norm(), 0, 1e-12);
  const double sigma = std::sqrt(0.06);  // by its residuals, one degree of freedom
  EXPECT_NEAR(line.sigma_end_m, sigma, 1e-12);
  EXPECT_NEAR(line.sigma_offset_m, sigma / std::sqrt(3), 1e-12);
  EXPECT_NEAR(line.sigma_angle_rad, sigma / std::sqrt(2), 1e-12);
  EXPECT_EQ(line.num_points, 3);
  EXPECT_NEAR(FitSegment(points, 0.5).sigma_offset_m, 0.5 / std::sqrt(3), 1e-12);
  // Two points have no residuals.
  EXPECT_NEAR(FitSegment({{4, 5}, {3, 5.3}}, 0.01).sigma_end_m, 0.01, 1e-12);
}

// Points of a wall at x = 3, each so far behind it, one a degree.
RangeScan UnevenWall(const std::vector<double>& offsets_m) {
  RangeScan scan{.first_angle_rad = -static_cast<double>(offsets_m.size() - 1) / 2 * std::numbers::pi / 180,
                 .step_rad = std::numbers::pi / 180};
  for (size_t i = 0; i < offsets_m.size(); ++i)
    scan.ranges_m.push_back((3 + offsets_m[i]) / std::cos(scan.AngleOf(i)));
  return scan;
}

TEST(ScanSegments, NeighboursThatOneLineFitsAreOne) {
  // The middle is 65 mm from the line through the ends, which divides the wall; of the line that fits all
  // nothing is farther than 40 mm.
  std::vector<double> offsets(41, 0);
  offsets[0] = offsets[40] = 0.04;
  offsets[20] = -0.025;
  auto segments = FindScanSegments(UnevenWall(offsets), {});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].num_points, 41);
  // As much apart, but 55 mm from what would fit all: more than three quarters of 60.  The middle belongs to
  // the first.
  offsets[0] = offsets[40] = 0.055;
  offsets[20] = -0.01;
  segments = FindScanSegments(UnevenWall(offsets), {});
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_EQ(segments[0].num_points, 21);
  EXPECT_EQ(segments[1].num_points, 20);
}

TEST(ScanSegments, APointDividesAWallThatIsFarEnoughFromIt) {
  std::vector<double> offsets(41, 0);
  offsets[20] = 0.058;
  EXPECT_EQ(FindScanSegments(UnevenWall(offsets), {}).size(), 1u);
  offsets[20] = 0.062;
  EXPECT_EQ(FindScanSegments(UnevenWall(offsets), {}).size(), 2u);
  // Of three points, too.
  const auto segments =
      FindScanSegments(UnevenWall({0, 0.5, 0}), {.max_gap_m = 10, .min_num_points = 2, .min_length_m = 0});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].num_points, 2);
}

TEST(ScanSegments, ShortOnesAreLeftOut) {
  EXPECT_EQ(FindScanSegments(UnevenWall(std::vector<double>(7, 0)), {}).size(), 1u);  // 31 cm
  EXPECT_EQ(FindScanSegments(UnevenWall(std::vector<double>(7, 0)), {.min_length_m = 0.32}).size(), 0u);
  const ScanSegmentsOptions any_length{.min_length_m = 0};
  EXPECT_EQ(FindScanSegments(UnevenWall(std::vector<double>(6, 0)), any_length).size(), 1u);
  EXPECT_EQ(FindScanSegments(UnevenWall(std::vector<double>(5, 0)), any_length).size(), 0u);
  EXPECT_EQ(FindScanSegments(UnevenWall({0, 0}), {.min_num_points = 1, .min_length_m = 0}).size(), 1u);
}

// A wall a metre to the left that goes on for 30 m: the lower the angle at which it is seen, the farther are
// its points apart.
TEST(ScanSegments, AWallIsFollowedToALowAngle) {
  RangeScan scan{.first_angle_rad = RadFromDeg(2), .step_rad = RadFromDeg(0.5)};
  for (int i = 0; i <= 176; ++i) scan.ranges_m.push_back(1 / std::sin(scan.AngleOf(i)));
  RangeScan stated{.ranges_m = scan.ranges_m};
  for (int i = 0; i <= 176; ++i) stated.angles_rad.push_back(scan.AngleOf(i));
  const auto farthest = [](const RangeScan& of, double max_gap_m) {
    const auto segments = FindScanSegments(of, {.max_range_m = 50, .max_gap_m = max_gap_m});
    return segments.empty() ? 0 : segments.back().start.x();
  };
  const auto x_at = [&](int i) { return 1 / std::tan(scan.AngleOf(i)); };
  int by_angle = 176, by_gap = 176;
  // 5.8 = 1 / sin(10 degrees): so many times its range times the step.
  while (x_at(by_angle - 1) - x_at(by_angle) <= 5.8 * scan.ranges_m[by_angle] * scan.step_rad) --by_angle;
  while (x_at(by_gap - 1) - x_at(by_gap) <= 0.5) --by_gap;
  EXPECT_NEAR(DegFromRad(scan.AngleOf(by_angle)), 10, 0.51);
  EXPECT_NEAR(farthest(scan, 1e-3), x_at(by_angle), 1e-9);
  EXPECT_NEAR(farthest(stated, 1e-3), x_at(by_angle), 1e-9);
  EXPECT_LT(by_gap, by_angle);
  EXPECT_NEAR(farthest(scan, 0.5), x_at(by_gap), 1e-9);
}

// A wall 20 cm ahead, and a beam in the middle that measured nothing.
TEST(ScanSegments, ABeamWithoutARangeDividesAWall) {
  RangeScan scan = UnevenWall(std::vector<double>(41, -2.8));
  EXPECT_EQ(FindScanSegments(scan, {.min_length_m = 0.02}).size(), 1u);
  scan.ranges_m[20] = 0;
  const auto segments = FindScanSegments(scan, {.min_length_m = 0.02});
  ASSERT_EQ(segments.size(), 2u);
  EXPECT_EQ(segments[0].num_points, 20);
  EXPECT_EQ(segments[1].num_points, 20);
}

// A laser that turns clockwise, or stands upside down, sees the same walls.
TEST(ScanSegments, ClockwiseScansHaveTheSameSegments) {
  const RangeScan scan =
      Measure({{{3, -2}, {3, 0}}, {{3, 1}, {3, 2}}, {{3, 2}, {-1, 2}}, {{1.2, -1}, {6, -1.05}}}, 0.005, 1);
  RangeScan clockwise{.first_angle_rad = scan.AngleOf(359), .step_rad = -scan.step_rad}, stated;
  clockwise.ranges_m.assign(scan.ranges_m.rbegin(), scan.ranges_m.rend());
  stated.ranges_m = clockwise.ranges_m;
  for (int i = 359; i >= 0; --i) stated.angles_rad.push_back(scan.AngleOf(i));
  const auto expected = FindScanSegments(scan, {});
  ASSERT_EQ(expected.size(), 4u);
  for (const RangeScan& turned : {clockwise, stated}) {
    const auto segments = FindScanSegments(turned, {});
    ASSERT_EQ(segments.size(), 4u);
    for (int i = 0; i < 4; ++i) {
      // A point between two stretches belongs to the first that is met.
      EXPECT_NEAR((segments[3 - i].start - expected[i].start).norm(), 0, 0.07);
      EXPECT_NEAR((segments[3 - i].end - expected[i].end).norm(), 0, 0.07);
      EXPECT_GT(segments[i].start.x() * segments[i].end.y() - segments[i].start.y() * segments[i].end.x(), 0);
    }
  }
}

TEST(ScanSegments, OptionsHaveTheirRanges) {
  ScanSegmentsOptions options;
  const auto is_allowed = [&] { return CheckOptions(DescribeOptions(&options)).ok(); };
  for (const auto& [value, least, most] :
       {std::tuple<double*, double, double>{&options.max_range_m, 0.01, 1e4},
        {&options.sigma_range_m, 1e-6, 10},
        {&options.split_m, 1e-6, 10},
        {&options.max_gap_m, 1e-3, 100},
        {&options.min_length_m, 0, 100}}) {
    const double usual = *value;
    for (const double allowed : {least, most}) {
      *value = allowed;
      EXPECT_TRUE(is_allowed()) << allowed;
    }
    for (const double refused : {least == 0 ? -0.01 : 0.9 * least, 1.01 * most}) {
      *value = refused;
      EXPECT_FALSE(is_allowed()) << refused;
    }
    *value = usual;
  }
  options.min_num_points = 2;
  EXPECT_TRUE(is_allowed());
  options.min_num_points = 1;
  EXPECT_FALSE(is_allowed());
}

std::string Repeated(const std::string& word, int num) {
  std::string words;
  for (int i = 0; i < num; ++i) words += word + " ";
  return words;
}

TEST(CarmenLog, BeamsAreOverHalfATurn) {
  // Even: a step less than half a turn; odd: all of it.
  for (const auto& [num_beams, step_deg] :
       {std::pair(1, 180.0), {2, 90.0}, {3, 90.0}, {5, 45.0}, {180, 1.0}, {181, 1.0}}) {
    const auto scans =
        Scans(fmt::format("FLASER {} {} 1 2 0.5 1 2 0.5 7\n", num_beams, Repeated("3", num_beams)));
    ASSERT_EQ(scans.size(), 1u);
    EXPECT_DOUBLE_EQ(scans[0].first_angle_rad, -std::numbers::pi / 2);
    EXPECT_DOUBLE_EQ(scans[0].step_rad, RadFromDeg(step_deg)) << num_beams;
  }
}

TEST(CarmenLog, LinesHaveAllTheirWords) {
  const auto is_read = [](const std::string& line) { return ParseCarmenLog(line + "\n", "log").ok(); };
  const std::string head = "ROBOTLASER1 4 -1.2 2.4 0.02 30 0.01 0",
                    poses = " 1 2 0.5 0.9 1.9 0.5 0 0 0 0 0 7.25 host";
  // Without the host and the time of the logger a FLASER line is a scan.
  EXPECT_TRUE(is_read("FLASER 2 3 3 1 2 0.5 1 2 0.5 7"));
  EXPECT_FALSE(is_read("FLASER 2 3 3 1 2 0.5 1 2 0.5"));
  EXPECT_FALSE(is_read("FLASER 0 1 2 0.5 1 2 0.5 7 h 7"));
  EXPECT_FALSE(is_read("FLASER -1 1 2 0.5 1 2 0.5 7 h 7"));
  EXPECT_FALSE(is_read("FLASER "));
  EXPECT_TRUE(is_read(head + " 1 4 2 10 11" + poses + " 7.5"));
  EXPECT_FALSE(is_read(head + " 1 4 2 10 11" + poses));
  EXPECT_FALSE(is_read(head + " 1 4 3 10 11" + poses + " 7.5"));
  EXPECT_FALSE(is_read(head));
  EXPECT_FALSE(is_read(head + " 1 4"));
  EXPECT_FALSE(is_read("ROBOTLASER1 4 1e308 2.4 0.02 30 0.01 0 1 4 0" + poses + " 7.5"));
  EXPECT_TRUE(is_read("ROBOTLASER1 4 -1.2 2.4 -0.02 30 0.01 0 1 4 0" + poses + " 7.5"));
  EXPECT_THAT(ParseCarmenLog("ROBOTLASER1 4 -1.2 2.4 1e308 30 0.01 0 1 4 0" + poses + " 7.5\n", "log")
                  .error()
                  .message,
              HasSubstr("log: line 1: angles from -1.2 rad on, 1e308 rad apart"));
  EXPECT_FALSE(is_read("ODOM 1 2\nFLASER 1 3 1 2 0.5 1 2 0.5 7"));
  EXPECT_TRUE(is_read("ODOM 1 2 3\nFLASER 1 3 1 2 0.5 1 2 0.5 7"));
  ExpectOdometry(
      Scans("PARAM robot_frontlaser_offset 0.5\nODOM 1 2 0 0 0 0 1 h 1\nFLASER 1 2 7 8 0 7 8 0 1 h 1\n")[0],
      1.5, 2, 0);
}

TEST(CarmenLog, ScansHaveUpToAHundredThousandBeams) {
  const std::string most = Repeated("3", 100000), poses = " 1 2 0.5 0.9 1.9 0.5 0 0 0 0 0 7.25 host 7.5\n",
                    robot = "ROBOTLASER1 4 -1.2 2.4 0.02 30 0.01 0 ";
  EXPECT_TRUE(ParseCarmenLog("FLASER 100000 " + most + " 1 2 0.5 1 2 0.5 7\n", "log").ok());
  EXPECT_FALSE(ParseCarmenLog("FLASER 100001 3 " + most + " 1 2 0.5 1 2 0.5 7\n", "log").ok());
  EXPECT_TRUE(ParseCarmenLog(robot + "100000 " + most + "0" + poses, "log").ok());
  EXPECT_FALSE(ParseCarmenLog(robot + "100001 3 " + most + "0" + poses, "log").ok());
  EXPECT_TRUE(ParseCarmenLog(robot + "1 3 100000 " + most + poses, "log").ok());
  EXPECT_FALSE(ParseCarmenLog(robot + "1 3 100001 3 " + most + poses, "log").ok());
}

TEST(CarmenLog, ALaserMaySeeLessThanAMetre) {
  EXPECT_EQ(Scans("FLASER 20 " + Repeated("0.5", 20) + "1 2 0.5 1 2 0.5 7\n").at(0).max_range_m, 0.5);
}

TEST(CarmenLog, MessagesWithoutATimeAreAsLateAsTheOneBefore) {
  const std::string scan = "FLASER 1 2 7 8 0 7 8 0 ";
  // Of 8 or 11 words, and of a time that is no number.
  for (const std::string rest : {"0 0 4 h", "0 0 0 4 h 4 more", "0 0 0 nan h nan"}) {
    const auto scans =
        Scans("ODOM 0 0 0 0 0 0 2 h 2\nODOM 1 0 0 " + rest + "\n" + scan + "3 h 3\nODOM 3 0 0 0 0 0 4 h 4\n");
    ExpectOdometry(scans.at(0), 2, 0, 0);
  }
  // The first at 0.
  ExpectOdometry(Scans("ODOM 1 0 0\n" + scan + "0.5 h 1\nODOM 3 0 0 0 0 0 2 h 2\n").at(0), 1.5, 0, 0);
  // Where no message has a time, 0 is no correction.
  ExpectOdometry(Scans("ODOM 1 2 3\nODOM 2 2 3 0 0 0 0 h 0\n" + scan + "1 h 1\n").at(0), 2, 2, 3);
  // A second is a time like others.
  ExpectOdometry(Scans("ODOM 1 2 3 0 0 0 1 h 1\nODOM 2 2 3 0 0 0 0 h 0\n" + scan + "1 h 1\n").at(0), 1, 2, 3);
}

TEST(CarmenLog, ClocksMayDisagree) {
  const std::string scan = "FLASER 1 2 7 8 0 7 8 0 ";
  const auto at = [&](const std::string& time) {
    return Scans("ODOM 0 0 0 0 0 0 5 h 5\n" + scan + time + " h 1\nODOM 1 0 0 0 0 0 5.5 h 5\n")
        .at(0)
        .odometry->position.x();
  };
  EXPECT_EQ(at("4"), 0);
  EXPECT_NEAR(at("5.25"), 0.5, 1e-12);
  EXPECT_EQ(at("7"), 1);
  // Between two messages of one time: as before.
  ExpectOdometry(Scans("ODOM 0 0 0 0 0 0 5 h 5\n" + scan + "6 h 6\nODOM 1 0 0 0 0 0 5 h 5\n").at(0), 0, 0, 0);
}

TEST(CarmenLog, WheelsDifferByAPlaceOrByAHeading) {
  const std::string odometry = "ODOM 5 5 0 0 0 0 1 h 1\n";
  ExpectOdometry(Scans(odometry + "FLASER 1 2 1 2 0.5 1 2 0.4 1 h 1\n").at(0), 1, 2, 0.4);
  ExpectOdometry(Scans(odometry + "FLASER 1 2 1 2 0.5 1 3 0.5 1 h 1\n").at(0), 1, 3, 0.5);
  ExpectOdometry(Scans(odometry + "FLASER 1 2 1 2 0.5 1 2 0.5 1 h 1\n").at(0), 5, 5, 0);
}

TEST(ReadScans, SegmentsHaveTheirBoundsAndTheirUsualErrors) {
  const auto scans = ParseScans("100000,1,-100000,1\n3,-2,3,2\n", "scan", {.sigma_range_m = 0.02});
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  EXPECT_EQ((*scans)[0].segments[1].sigma_offset_m, 0.02);
  EXPECT_NEAR((*scans)[0].segments[1].sigma_angle_rad, 2 * 0.02 / 4, 1e-12);
  for (const char* line : {"1,1,2,3,0.5,0", "1,1,2,3,0.5", "1,1,2,100001", "-100001,1,2,3", "0,0,2,3"})
    EXPECT_EQ(ParseScans(line, "scan", {}).error().code, ErrorCode::kCorrupt) << line;
  EXPECT_THAT(ParseScans("1,1,2,3,0,0.01", "scan", {}).error().message,
              HasSubstr("standard deviations 0 and 0.01"));
  const auto stated = ParseScans("1,-0.1,1,0.1,0.5,0.03\n", "scan", {});
  EXPECT_EQ(stated->at(0).segments[0].start, Vec2(1, -0.1));
  EXPECT_EQ(stated->at(0).segments[0].sigma_offset_m, 0.03);
  // Of a long line its beginning is said.
  EXPECT_THAT(ParseScans("  " + std::string(79, 'x') + "yz\n", "scan", {}).error().message,
              HasSubstr('"' + std::string(79, 'x') + "y\" is not x0"));
}

}  // namespace
}  // namespace cairn
