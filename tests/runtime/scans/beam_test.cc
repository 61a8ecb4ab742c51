#include "runtime/scans/beam.h"

#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/scans/carmen_log.h"
#include "runtime/scans/read_scans.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

TEST(Beams, OfAScan) {
  RangeScan scan;
  scan.first_angle_rad = -std::numbers::pi / 2;
  scan.step_rad = std::numbers::pi / 4;
  scan.ranges_m = {1, 0, 2, -1, 30, 4};
  scan.ranges_m.push_back(std::numeric_limits<double>::quiet_NaN());
  scan.ranges_m.push_back(std::numeric_limits<double>::infinity());
  const std::vector<Beam> beams = BeamsOf(scan, 20);
  ASSERT_EQ(beams.size(), 5u);
  EXPECT_NEAR((beams[0].End() - Vec2(0, -1)).norm(), 0, 1e-12);
  EXPECT_NEAR((beams[1].End() - Vec2(2, 0)).norm(), 0, 1e-12);
  EXPECT_TRUE(beams[0].met && beams[1].met && beams[3].met);
  EXPECT_FALSE(beams[2].met);
  EXPECT_EQ(beams[2].range_m, 20);
  EXPECT_NEAR(beams[2].direction.y(), 1, 1e-12);
  EXPECT_EQ(beams[4].range_m, 20);
  // A laser that sees 4 m.
  scan.max_range_m = 4;
  const std::vector<Beam> near = BeamsOf(scan, 20);
  EXPECT_FALSE(near[3].met);
  EXPECT_EQ(near[2].range_m, 4);
}

TEST(Beams, ToSegments) {
  // 90 degrees of a wall 2 m to the left, and a short one far ahead.
  const std::vector<ScanSegment> segments = {{{2, 2}, {-2, 2}}, {{10, -0.1}, {10, 0.1}}};
  const std::vector<Beam> beams = BeamsTo(segments);
  ASSERT_EQ(beams.size(), 90u + 5u);
  for (size_t i = 0; i < beams.size(); ++i) {
    EXPECT_TRUE(beams[i].met);
    EXPECT_NEAR(beams[i].direction.norm(), 1, 1e-12);
    if (i < 90) {
      EXPECT_NEAR(beams[i].End().y(), 2, 1e-9);
      EXPECT_LE(std::abs(beams[i].End().x()), 2);
    } else {
      EXPECT_NEAR(beams[i].End().x(), 10, 1e-9);
    }
  }
  EXPECT_NEAR(beams[0].direction.dot(beams[1].direction), std::cos(std::numbers::pi / 180), 1e-9);
}

TEST(Beams, ToASegmentSeenAlongItsLine) {
  const std::vector<ScanSegment> edge_on = {
      {{-5.484349462573257, -2.1818310745344851}, {-1.8189796189204108, -0.72364211718983562}},
      {{1, 1e-13}, {9, -1e-13}}};
  for (const Beam& beam : BeamsTo(edge_on)) {
    EXPECT_LT(beam.range_m, 9.1);
    EXPECT_GT(beam.range_m, 0);
    EXPECT_NEAR(beam.direction.norm(), 1, 1e-9);
  }
}

TEST(ScanSegments, BeamsOfTheLasersLargestRangeAreNoWall) {
  RangeScan scan;
  scan.first_angle_rad = -std::numbers::pi / 4;
  scan.step_rad = std::numbers::pi / 180;
  scan.ranges_m.assign(90, 8.19);
  EXPECT_FALSE(FindScanSegments(scan, {}).empty());
  scan.max_range_m = 8.19;
  EXPECT_TRUE(FindScanSegments(scan, {}).empty());
}

std::string Log(const std::string& ranges, int num) {
  return "FLASER " + std::to_string(num) + " " + ranges + " 1 2 0.5 0 0 0 10 host 20\n";
}

TEST(CarmenLog, TheLargestRangeIsTheLasersWhereItOccursOften) {
  std::string often, seldom;
  for (int i = 0; i < 19; ++i) {
    often += "8.19 ";
    seldom += "8.19 ";
  }
  often += "8.19 2 3";
  seldom += "8.18 2 3";
  const auto with = ParseCarmenLog(Log(often, 22), "log");
  ASSERT_TRUE(with.ok());
  EXPECT_EQ(with->at(0).max_range_m, 8.19);
  const auto without = ParseCarmenLog(Log(seldom, 22), "log");
  EXPECT_TRUE(std::isinf(without->at(0).max_range_m));
  // In the scan's view: beams of that range met nothing.
  const auto views = ParseScans(Log(often, 22), "log", {});
  ASSERT_TRUE(views.ok());
  EXPECT_EQ(std::count_if(views->at(0).beams.begin(), views->at(0).beams.end(),
                          [](const Beam& b) { return b.met; }),
            2);
}

TEST(ReadScans, ScansOfSegmentsHaveBeamsToThem) {
  const auto views = ParseScans("-1,-1,2.5,-1\n2.5,-1,2.5,0.5\n", "scan", {});
  ASSERT_TRUE(views.ok());
  EXPECT_GT(views->at(0).beams.size(), 100u);
}

TEST(Beams, ToSegmentsAreInTheMiddlesOfTheirSteps) {
  const auto angle = [](const Beam& beam) { return std::atan2(beam.direction.y(), beam.direction.x()); };
  // From 45 to 76 degrees of a wall to the left: 30 beams, none beyond its nearer end.
  const std::vector<Beam> beams = BeamsTo({{{2, 2}, {0.5, 2}}});
  ASSERT_EQ(beams.size(), 30u);
  const double step = (std::atan2(2, 0.5) - std::atan2(2, 2)) / 30;
  for (int i = 0; i < 30; ++i) EXPECT_NEAR(angle(beams[i]), std::atan2(2, 2) + (i + 0.5) * step, 1e-12);
  // 178.85 degrees.
  EXPECT_EQ(BeamsTo({{{100, 1}, {-100, 1}}}).size(), 178u);
}

}  // namespace
}  // namespace cairn
