#include "runtime/scans/laser_json.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "runtime/scans/read_scans.h"

namespace cairn {
namespace {

using testing::HasSubstr;

std::string Scan(const std::string& ranges, const std::string& more = "") {
  return R"({"angle_min": -0.5, "angle_increment": 0.25, "range_min": 0.1, "range_max": 8, "ranges": [)" +
         ranges + "]" + more + "}\n";
}

std::string Stamp(double seconds) {
  const int whole = static_cast<int>(seconds);
  return fmt::format(R"(, "header": {{"stamp": {{"sec": {}, "nanosec": {:.0f}}}, "frame_id": "laser"}})",
                     whole, 1e9 * (seconds - whole));
}

std::string Odometry(double x, double y, double heading_rad, const std::string& more) {
  return fmt::format(
             R"({{"pose": {{"pose": {{"position": {{"x": {}, "y": {}, "z": 0}}, "orientation": {{"x": 0, "y": 0, "z": {}, "w": {}}}}}}}, "twist": {{}}{}}})",
             x, y, std::sin(heading_rad / 2), std::cos(heading_rad / 2), more) +
         "\n";
}

TEST(LaserJson, ReadsScansOfAnyAngleAndRange) {
  const auto scans = ParseLaserJson("\n" + Scan("1, 2.5, null, 8, 0.05") + "{\"data\": \"other\"}\n" +
                                        Scan("Infinity, -Infinity, NaN, 3", Stamp(12.25)),
                                    "log");
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  ASSERT_EQ(scans->size(), 2u);
  const RangeScan& first = (*scans)[0];
  EXPECT_EQ(first.first_angle_rad, -0.5);
  EXPECT_EQ(first.step_rad, 0.25);
  EXPECT_EQ(first.max_range_m, 8);
  EXPECT_EQ(first.ranges_m.size(), 5u);
  EXPECT_EQ(first.ranges_m[1], 2.5);
  EXPECT_FALSE(first.odometry);
  EXPECT_NEAR((*scans)[1].time_s, 12.25, 1e-9);
  // What met nothing, and what is left out.
  const auto views =
      ParseScans(Scan("1, 2.5, null, 8, 0.05") + Scan("Infinity, -Infinity, NaN, 3"), "log", {});
  ASSERT_TRUE(views.ok());
  ASSERT_EQ(views->at(0).beams.size(), 3u);
  EXPECT_TRUE(views->at(0).beams[1].met);
  EXPECT_NEAR(std::atan2(views->at(0).beams[1].direction.y(), views->at(0).beams[1].direction.x()), -0.25,
              1e-12);
  EXPECT_FALSE(views->at(0).beams[2].met);
  EXPECT_EQ(views->at(0).beams[2].range_m, 8);
  ASSERT_EQ(views->at(1).beams.size(), 2u);
  EXPECT_FALSE(views->at(1).beams[0].met);
  EXPECT_EQ(views->at(1).beams[1].range_m, 3);
}

TEST(LaserJson, OdometryIsThatOfTheMessagesAroundAScan) {
  const auto scans = ParseLaserJson(Odometry(1, 2, 3, Stamp(10)) + Scan("1", Stamp(10.5)) +
                                        Odometry(3, 2, -3, Stamp(12)) + Scan("1", Stamp(13)),
                                    "log");
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  ASSERT_EQ(scans->size(), 2u);
  ASSERT_TRUE((*scans)[0].odometry);
  EXPECT_NEAR((*scans)[0].odometry->position.x(), 1.5, 1e-6);
  EXPECT_NEAR((*scans)[0].odometry->heading_rad, 3 + 0.25 * (2 * std::numbers::pi - 6), 1e-6);
  EXPECT_EQ((*scans)[1].odometry->position, Eigen::Vector2d(3, 2));
  // Other poses, and other messages, are nothing; a message may be wrapped.
  const auto wrapped =
      ParseLaserJson("{\"pose\": {\"position\": {\"x\": 1}}}\n{\"op\": \"publish\", \"msg\": " +
                         Scan("1, 2").substr(0, Scan("1, 2").size() - 1) + "}\n",
                     "log");
  ASSERT_TRUE(wrapped.ok()) << wrapped.error().message;
  EXPECT_EQ((*wrapped)[0].ranges_m.size(), 2u);
  EXPECT_FALSE((*wrapped)[0].odometry);
  // ROS 1, and stamps as numbers.
  const auto other = ParseLaserJson(Scan("1", R"(, "header": {"stamp": {"secs": 3, "nsecs": 500000000}})") +
                                        Scan("1", R"(, "header": {"stamp": 4.5})"),
                                    "log");
  ASSERT_TRUE(other.ok());
  EXPECT_NEAR((*other)[0].time_s, 3.5, 1e-9);
  EXPECT_NEAR((*other)[1].time_s, 4.5, 1e-9);
}

TEST(LaserJson, WhatIsNoMessageIsRefusedByItsLine) {
  for (const auto& [text, message] :
       {std::pair<std::string, std::string>{"{\"ranges\": [1]}\n",
                                            "line 1: a LaserScan without a number as \"angle_min\""},
        {Scan("1") + "{\"ranges\": [1], \"angle_min\": 0, \"angle_increment\": 1e300, \"range_max\": 1}",
         "line 2"},
        {Scan("1") + Scan("\"far\""), "line 2: a range is \"far\", no number"},
        {"{\"angle_min\": 0, \"angle_increment\": 1, \"range_max\": 1, \"ranges\": 5}",
         "\"ranges\" is no list"},
        {Scan("1") + "{\"twist\": 0, \"pose\": {\"pose\": {\"position\": {\"x\": 1, \"y\": 1}, "
                     "\"orientation\": {\"x\": 0, \"y\": 0, \"z\": 0, \"w\": 0}}}}",
         "squared length of 0"},
        {Scan("1") + "{\"ranges\": [1", "line 2: \"{"},
        {Scan("1") + "[1]", "is no message as JSON"},
        {Scan("1") + "{\"twist\": 0, \"pose\": {\"pose\": {\"position\": {\"x\": 1}}}}",
         "without a number as \"pose.pose.position.y\""},
        {Scan("1") + "{\"twist\": 0, \"pose\": 3}", "pose.pose.position.x"}}) {
    const auto refused = ParseLaserJson(text, "log");
    ASSERT_FALSE(refused.ok()) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt) << text;
    EXPECT_THAT(refused.error().message, HasSubstr(message)) << text;
    EXPECT_THAT(refused.error().message, HasSubstr("log: line "));
  }
  EXPECT_EQ(ParseLaserJson("{\"data\": 1}\n", "log").error().code, ErrorCode::kNoData);
  EXPECT_EQ(ParseScans("{\"data\": 1}\n", "log", {}).error().code, ErrorCode::kNoData);
}

TEST(LaserJson, RangesBelowTheLeastAreLeftOut) {
  const auto scans = ParseLaserJson(
      Scan("0.1, 0.09, 8") + R"({"angle_min": 0, "angle_increment": 1, "range_max": 8, "ranges": [0.5]})",
      "log");
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  EXPECT_EQ((*scans)[0].ranges_m[0], 0.1);
  EXPECT_TRUE(std::isnan((*scans)[0].ranges_m[1]));
  EXPECT_EQ((*scans)[0].ranges_m[2], 8);
  EXPECT_EQ((*scans)[1].ranges_m[0], 0.5);  // no least one is stated
  EXPECT_EQ((*scans)[1].time_s, 0);
}

TEST(LaserJson, AStampHasBothItsParts) {
  const auto scans = ParseLaserJson(Scan("1", R"(, "header": {"stamp": {"sec": 5}})") +
                                        Scan("1", R"(, "header": {"stamp": {"nanosec": 5}})") +
                                        Scan("1", R"(, "header": 5)"),
                                    "log");
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  for (const RangeScan& scan : *scans) EXPECT_EQ(scan.time_s, 0);
}

// The base may be tilted: its heading is that of its x on the floor.
TEST(LaserJson, HeadingsAreThoseOfTiltedBasesToo) {
  const Eigen::Quaterniond q(Eigen::AngleAxisd(0.9, Eigen::Vector3d(2, -1, 3).normalized()));
  const auto message = [&](double x, double y, double scale) {
    return fmt::format(
        R"({{"pose": {{"pose": {{"position": {{"x": {}, "y": {}}}, "orientation": {{"x": {}, "y": {}, "z": {}, "w": {}}}}}}}, "twist": {{}}}})",
        x, y, scale * q.x(), scale * q.y(), scale * q.z(), scale * q.w());
  };
  const auto scans = ParseLaserJson(message(1, 2, 1) + "\n" + Scan("1"), "log");
  ASSERT_TRUE(scans.ok()) << scans.error().message;
  const Eigen::Vector3d ahead = q * Eigen::Vector3d::UnitX();
  ASSERT_TRUE((*scans)[0].odometry);
  EXPECT_EQ((*scans)[0].odometry->position, Eigen::Vector2d(1, 2));
  EXPECT_NEAR((*scans)[0].odometry->heading_rad, std::atan2(ahead.y(), ahead.x()), 1e-9);
  // Of a length of 1, but for rounding; and not farther away than anything.
  EXPECT_TRUE(ParseLaserJson(message(-1e9, 1e9, std::sqrt(1.009)) + "\n" + Scan("1"), "log").ok());
  for (const std::string& bad : {message(1, 2, std::sqrt(1.011)), message(1, 2, std::sqrt(0.989)),
                                 message(-1.1e9, 2, 1), message(1, 1.1e9, 1)}) {
    const auto refused = ParseLaserJson(Scan("1") + bad, "log");
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_THAT(refused.error().message, HasSubstr("log: line 2: an Odometry at ("));
  }
}

TEST(LaserJson, LongListsAndLinesHaveAnEnd) {
  std::string most;
  for (int i = 0; i < kMaxBeams; ++i) most += i == 0 ? "1" : ",1";
  EXPECT_TRUE(ParseLaserJson(Scan(most), "log").ok());
  EXPECT_TRUE(
      ParseLaserJson(R"({"angle_min": 0, "angle_increment": 1, "range_max": 1e5, "ranges": [1]})", "log")
          .ok());
  EXPECT_THAT(ParseLaserJson(Scan(most + ",1"), "log").error().message,
              HasSubstr("no list of up to 100000 numbers"));
  // Of a line that is no message its beginning is said.
  EXPECT_THAT(ParseLaserJson("  " + std::string(79, 'x') + "yz\n", "log").error().message,
              HasSubstr('"' + std::string(79, 'x') + "y\" is no message"));
}

}  // namespace
}  // namespace cairn
