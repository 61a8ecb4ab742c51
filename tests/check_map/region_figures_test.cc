#include "stages/check_map/region_figures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/quantiles.h"
#include "stages/check_map/report.h"
#include "tests/runtime/localize/synthetic_room.h"

namespace cairn::check_map {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

//   station    0   1   2   3        a metre apart on the x axis
//   region 0   x   x
//   region 1       x   x            station 3 is in no region
MapRows FourStations() {
  MapRows rows;
  for (int x = 0; x < 4; ++x) rows.stations.push_back({.position = {x, 0}});
  rows.regions = {{.stations = {0, 1}}, {.stations = {1, 2}}};
  return rows;
}

Pose StandingAt(double x, double heading_deg = 0) { return PoseAt({x, 0, 1.2}, heading_deg); }

std::optional<StationIdx> Station(const MapRows& rows, const Pose& pose) {
  return StationOf(pose, StationSpacingM(rows.stations), rows, {});
}

// A fix that is off by so much, or none.
HeldOutResult Outcome(std::optional<double> error_m) {
  HeldOutResult result;
  result.localization.reason = error_m ? NoFix::kNone : NoFix::kTooFewMatches;
  if (!error_m) return result;
  result.error_m = *error_m;
  result.error_deg = 10 * *error_m;
  return result;
}

TEST(RegionFigures, ImageStandsAtTheNearestStationUnlessItIsTooFar) {
  const MapRows rows = FourStations();
  EXPECT_EQ(StationSpacingM(rows.stations), 1);
  EXPECT_EQ(Station(rows, StandingAt(1.4)), 1);
  EXPECT_EQ(Station(rows, StandingAt(1.5)), 1);  // as near to 2: the first
  EXPECT_EQ(Station(rows, StandingAt(4.5)), 3);
  EXPECT_EQ(Station(rows, StandingAt(4.51)), std::nullopt);
}

TEST(RegionFigures, SpacingIsTheMedianDistanceToTheNextOtherPlace) {
  Random random(3);
  for (int num_stations : {1, 2, 7, 60}) {
    std::vector<MapStation> stations;
    for (int i = 0; i < num_stations; ++i) {
      const Eigen::Vector2d place(random.Uniform(0, 5), random.Uniform(0, 5));
      // Some places have several headings.
      for (int heading = 0; heading <= i % 3; ++heading)
        stations.push_back({.position = place, .heading_deg = 90.0 * heading});
    }
    std::vector<double> nearest;
    for (const MapStation& station : stations) {
      double least = 1e9;
      for (const MapStation& other : stations) {
        const double distance = (other.position - station.position).norm();
        if (distance > 0) least = std::min(least, distance);
      }
      if (least < 1e9) nearest.push_back(least);
    }
    EXPECT_EQ(StationSpacingM(stations), nearest.empty() ? 0 : Quantile(nearest, 0.5)) << num_stations;
  }
}

TEST(RegionFigures, StationOfAnotherHeadingIsPassedOver) {
  //  station   0: (0, 0) 0 deg    1: (0, 0) 90 deg    2: (1, 0) 270 deg
  MapRows rows;
  rows.stations = {{.position = {0, 0}, .heading_deg = 0},
                   {.position = {0, 0}, .heading_deg = 90},
                   {.position = {1, 0}, .heading_deg = 270}};
  EXPECT_EQ(Station(rows, StandingAt(0, 40)), 0);
  EXPECT_EQ(Station(rows, StandingAt(0, 50)), 1);
  EXPECT_EQ(Station(rows, StandingAt(0, 350)), 0);
  EXPECT_EQ(Station(rows, StandingAt(0, 280)), 2);
  EXPECT_EQ(Station(rows, StandingAt(0, 180)), std::nullopt);
}

TEST(RegionFigures, StatedPosesAreTakenIntoTheMapsFrame) {
  // The map's cameras stand a metre to the right of where the survey says (x right, y down, z forward).
  MapRows rows = FourStations();
  rows.camera_from_given.translation = {-1, 0, 0};
  EXPECT_EQ(Station(rows, StandingAt(1, 90)), 2);
}

TEST(RegionFigures, ImageCountsInEveryRegionOfItsStationOrOutside) {
  const MapRows rows = FourStations();
  std::vector<HeldOutResult> results;
  const auto add = [&](double x, std::optional<double> error_m) {
    results.push_back(Outcome(error_m));
    results.back().true_cam_from_world = StandingAt(x);
  };
  add(0, 0.01);
  add(0.1, 0.04);
  add(1, 0.02);  // in both
  add(2, 0.8);   // gross
  add(2.1, std::nullopt);
  add(3, 0.03);                     // a station of no region
  add(50, std::nullopt);            // no station
  results.push_back(Outcome(0.5));  // of another place

  FindStations(rows, {}, &results);
  EXPECT_EQ(results[2].station, 1);
  EXPECT_EQ(results[6].station, std::nullopt);
  EXPECT_EQ(results[7].station, std::nullopt);
  const std::vector<RegionSelfTest> regions = SummarizeRegions(rows, results, {});
  EXPECT_THAT(regions, ElementsAre(RegionSelfTest{-1, 2, 1, 0, RegionSelfTest::Errors{0.03, 0.3, 0.03, 0.3}},
                                   RegionSelfTest{0, 3, 3, 0, RegionSelfTest::Errors{0.02, 0.2, 0.04, 0.4}},
                                   RegionSelfTest{1, 3, 2, 1, RegionSelfTest::Errors{0.02, 0.2, 0.8, 8}}));
  EXPECT_TRUE(CheckMapFindings({.self_test_regions = regions},
                               {.num_regions = rows.regions.size(), .num_stations = rows.stations.size()})
                  .ok());
}

TEST(RegionFigures, GateNamesTheRegionTheFigureAndTheLimit) {
  CheckMapReport report;
  report.images.resize(20);
  report.regions = {{kOutsideRegions, 9, 0, 0, {}},
                    {0, 4, 0, 0, {}},
                    {1, 10, 9, 0, RegionSelfTest::Errors{}},
                    {2, 10, 8, 2, RegionSelfTest::Errors{}}};
  CheckMapOptions options;
  EXPECT_TRUE(CheckGate(report, options).ok());
  options.min_region_localized_ratio = 0.8;  // region 0 has too few images, outside is no region
  EXPECT_TRUE(CheckGate(report, options).ok());
  options.min_region_localized_ratio = 0.9;
  Status status = CheckGate(report, options);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kGate);
  EXPECT_THAT(status.error().message, HasSubstr("localized_ratio of region 2 is 0.800"));
  EXPECT_THAT(status.error().message, HasSubstr("at least 0.900"));
  options.min_region_held_out = 4;
  EXPECT_THAT(CheckGate(report, options).error().message, HasSubstr("of region 0 is 0.000"));

  options = {};
  options.min_region_precision_ratio = 0.76;
  EXPECT_THAT(CheckGate(report, options).error().message, HasSubstr("precision_ratio of region 2 is 0.750"));
  options.min_region_precision_ratio = 0.75;
  EXPECT_TRUE(CheckGate(report, options).ok());
}

TEST(RegionFigures, GateWithoutHeldOutImagesFails) {
  CheckMapOptions options;
  options.min_region_precision_ratio = 0.5;
  const Status status = CheckGate({}, options);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kGate);
  EXPECT_THAT(status.error().message, HasSubstr("no held-out images"));
  EXPECT_TRUE(CheckGate({}, {}).ok());
}

TEST(RegionFigures, ReportListsTheWorstRegionsFirst) {
  const std::vector<RegionSelfTest> regions = {{kOutsideRegions, 2, 0, 0, {}},
                                               {0, 4, 4, 0, RegionSelfTest::Errors{0.02, 0.2, 0.04, 0.4}},
                                               {7, 4, 3, 1, RegionSelfTest::Errors{0.03, 0.3, 0.8, 8}}};
  const std::string text = SelfTestRegionsText(regions, 2, {});
  EXPECT_LT(text.find("outside"), text.find("region 7"));
  EXPECT_THAT(text, HasSubstr("3.00 cm, 0.300 deg"));
  EXPECT_THAT(text, HasSubstr("66.7 %"));
  EXPECT_THAT(text, HasSubstr("and 1 better one"));
  EXPECT_EQ(SelfTestRegionsText({}, 2, {}), "");
  EXPECT_THAT(SelfTestRegionsText(regions, 2, {.unit = "arbitrary"}), HasSubstr("0.03 units, 0.300 deg"));

  const nlohmann::ordered_json json = SelfTestRegionsJson(regions);
  ASSERT_EQ(json.size(), 3u);
  EXPECT_TRUE(json[0]["region"].is_null());
  EXPECT_FALSE(json[0].contains("median_error_m"));
  EXPECT_EQ(json[2]["region"], 7);
  EXPECT_EQ(json[2]["p90_error_m"], 0.8);
}

}  // namespace
}  // namespace cairn::check_map
