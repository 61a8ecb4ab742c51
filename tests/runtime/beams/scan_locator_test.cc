#include "runtime/beams/scan_locator.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "runtime/beams/beam_model.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/scans/beam.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using testing::HasSubstr;
using Vec2 = Eigen::Vector2d;

Views PlanOf(const std::vector<PlanWall>& walls) {
  Views views;
  views.plan.walls = walls;
  return views;
}

ScanView ScanAt(const std::vector<PlanWall>& walls, const PlanarPose& pose, Random* random) {
  RangeScan scan;
  scan.first_angle_rad = RadFromDeg(-90);
  scan.step_rad = RadFromDeg(1);
  for (const Beam& beam : BeamsAt(walls, pose, 0.01, random)) scan.ranges_m.push_back(beam.range_m);
  return ViewOf(scan, {});
}

bool IsAt(const ScanHypothesis& found, const PlanarPose& pose) {
  return (found.pose.position - pose.position).norm() < 0.05 &&
         std::abs(WrapAngle(found.pose.heading_rad - pose.heading_rad)) < RadFromDeg(1);
}

LocatedScan Located(const Views& views, const ScanView& scan, const ScanLocatorOptions& options = {}) {
  const auto locator = ScanLocator::Make(views, options);
  EXPECT_TRUE(locator.ok());
  auto located = locator->Locate(scan);
  EXPECT_TRUE(located.ok()) << located.error().message;
  return located.ok() ? std::move(*located) : LocatedScan{};
}

TEST(ScanLocator, FindsWhereAScanWasTaken) {
  const Views views = PlanOf(OddRoom());
  Random random(1);
  for (int i = 0; i < 12; ++i) {
    const double x = random.Uniform(2.3, 3.8), y = random.Uniform(0.4, 4.6);
    const PlanarPose pose{{x, y}, random.Uniform(-3, 3)};
    const ScanView scan = ScanAt(views.plan.walls, pose, &random);
    const LocatedScan located = Located(views, scan);
    ASSERT_FALSE(located.hypotheses.empty());
    const ScanHypothesis& found = located.hypotheses[0];
    EXPECT_TRUE(IsAt(found, pose)) << i << ": " << found.pose.position.transpose();
    EXPECT_LT((found.pose.position - pose.position).norm(), 0.015);
    EXPECT_LT(std::abs(WrapAngle(found.pose.heading_rad - pose.heading_rad)), RadFromDeg(0.3));
    EXPECT_TRUE(found.determined);
    EXPECT_GT(found.probability, 0.5);
    EXPECT_GT(found.explained_ratio, 0.9);
    EXPECT_GT(located.num_tried, 1000);
    EXPECT_TRUE(located.complete);
    ASSERT_EQ(found.labels.size(), scan.segments.size());
    EXPECT_EQ(found.num_matched, std::ssize(scan.segments));
    EXPECT_EQ(found.hidden_length_m, 0);
    EXPECT_LT(found.rms_m, 0.03);
    EXPECT_EQ(Located(views, scan, {.least_odds = 1}).hypotheses.size(), 1u);
    double sum = 0;
    for (const ScanHypothesis& other : located.hypotheses) sum += other.probability;
    EXPECT_LE(sum, 1 + 1e-9);
  }
}

TEST(ScanLocator, ExpectedPlacesAreLookedAtHoweverImprobable) {
  const Views views = PlanOf(OddRoom());
  const auto locator = *ScanLocator::Make(views, {});
  Random random(1);
  const PlanarPose pose{{3, 3}, 0.4}, wrong{{6.5, 1}, 2};
  const ScanView scan = ScanAt(views.plan.walls, pose, &random);
  const auto at = [](const LocatedScan& located, const PlanarPose& near) {
    return std::find_if(located.hypotheses.begin(), located.hypotheses.end(),
                        [&](const ScanHypothesis& found) {
                          return (found.pose.position - near.position).norm() < 0.4 &&
                                 std::abs(WrapAngle(found.pose.heading_rad - near.heading_rad)) < 0.3;
                        });
  };
  const LocatedScan without = *locator.Locate(scan);
  EXPECT_EQ(at(without, wrong), without.hypotheses.end());
  EXPECT_FALSE(without.hypotheses[0].is_expected);
  const LocatedScan with = *locator.Locate(scan, std::vector{wrong});
  ASSERT_NE(at(with, wrong), with.hypotheses.end());
  EXPECT_TRUE(at(with, wrong)->is_expected);
  EXPECT_LT(at(with, wrong)->probability, 0.01);
  EXPECT_TRUE(with.complete);
  EXPECT_TRUE(IsAt(with.hypotheses[0], pose));
  EXPECT_FALSE(with.hypotheses[0].is_expected);
  EXPECT_NEAR(with.hypotheses[0].probability, without.hypotheses[0].probability, 1e-3);
  // Near to them alone: moved to where the beams fit.
  const PlanarPose off{{3.1, 2.95}, 0.45};
  const LocatedScan near = *locator.LocateNear(scan, std::vector{off});
  ASSERT_EQ(near.hypotheses.size(), 1u);
  EXPECT_TRUE(IsAt(near.hypotheses[0], pose));
  EXPECT_TRUE(near.hypotheses[0].is_expected);
  EXPECT_EQ(near.num_tried, 0);
  EXPECT_TRUE(locator.LocateNear(scan, {})->hypotheses.empty());
}

// A corridor is one place with or without knowing where in it the robot may be.
TEST(ScanLocator, ExpectedPlacesInARowAreNotCountedTwice) {
  const Views views = PlanOf({{{0, 0}, {40, 0}},
                              {{40, 2}, {0, 2}},
                              {{0, 0}, {0, 2}},
                              {{40, 0}, {40, 2}},
                              {{0, 10}, {9, 10}},
                              {{9, 10}, {9, 12}},
                              {{9, 12}, {0, 12}},
                              {{0, 12}, {0, 10}}});
  const auto locator = *ScanLocator::Make(views, {.least_odds = 1e-6});
  ScanView scan;
  for (int degree = 60; degree <= 120; ++degree) {
    for (const double sign : {1.0, -1.0}) {
      const Vec2 direction(std::cos(RadFromDeg(degree)), sign * std::sin(RadFromDeg(degree)));
      scan.beams.push_back({direction, 1 / std::abs(direction.y()), true});
    }
  }
  std::vector<PlanarPose> expected;
  for (int i = 0; i < 10; ++i) expected.push_back({{6 + 3.0 * i, 1}, 0});
  const LocatedScan without = *locator.Locate(scan), with = *locator.Locate(scan, expected);
  const auto in_long = [](const LocatedScan& located) {
    double sum = 0;
    for (const ScanHypothesis& found : located.hypotheses) {
      if (found.pose.position.y() < 5 && std::abs(found.pose.heading_rad) < 0.2) sum += found.probability;
    }
    return sum;
  };
  EXPECT_GT(in_long(without), 0.2);
  EXPECT_NEAR(in_long(with), in_long(without), 0.1);
  for (const ScanHypothesis& found : with.hypotheses)
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(found.covariance).eigenvalues()[0], 0);
}

TEST(ScanLocator, ADenseScanOfALargeHall) {
  // 7,200 beams all around, which end at 800 places along its walls.
  const std::vector<PlanWall> walls = {{{0, 0}, {31, 0}},  {{31, 0}, {31, 27}}, {{31, 27}, {0, 27}},
                                       {{0, 27}, {0, 0}},  {{4, 0}, {4, 3}},    {{20, 27}, {20, 22}},
                                       {{31, 9}, {27, 9}}, {{0, 18}, {2, 20}}};
  const PlanarPose pose{{13, 11}, 0.7};
  Random random(1);
  ScanView scan;
  for (int i = 0; i < 7200; ++i) {
    const Vec2 direction(std::cos(RadFromDeg(i / 20.0)), std::sin(RadFromDeg(i / 20.0)));
    const double range = NearestAlong(walls, pose.position, Eigen::Rotation2Dd(pose.heading_rad) * direction);
    scan.beams.push_back({direction, range + random.Normal(0, 0.01), true});
  }
  const LocatedScan located = Located(PlanOf(walls), scan);
  ASSERT_FALSE(located.hypotheses.empty());
  EXPECT_TRUE(IsAt(located.hypotheses[0], pose));
}

TEST(ScanLocator, SegmentsHaveTheWallsThatAreSeenFromThere) {
  const Views views = PlanOf(OddRoom());
  Random random(1);
  const PlanarPose pose{{3, 2.5}, 0};
  ScanView scan = ScanAt(views.plan.walls, pose, &random);
  const size_t num = scan.segments.size();
  // Of no wall; and of a wall's place that the pillar hides.
  scan.segments.push_back({{1, -1.3}, {1, -0.8}, 0.01, 0.01, 10});
  scan.segments.push_back({{4.4, 2.5}, {3.8, 2.5}, 0.01, 0.01, 10});
  const LocatedScan located = Located(views, scan);
  ASSERT_FALSE(located.hypotheses.empty());
  const ScanHypothesis& found = located.hypotheses[0];
  ASSERT_TRUE(IsAt(found, pose));
  EXPECT_EQ(found.num_matched, static_cast<int>(num));
  EXPECT_EQ(found.labels[num], -1);
  EXPECT_EQ(found.labels[num + 1], -1);
  EXPECT_GT(found.hidden_length_m, 0.1);
  double length = 0;
  for (size_t i = 0; i < num; ++i) {
    ASSERT_GE(found.labels[i], 0);
    length += scan.segments[i].Length();
    const Vec2 middle = found.pose.FloorFromRobot(scan.segments[i].Middle());
    const Vec2 start = LabelStart(views.plan, found.labels[i]);
    const Vec2 along = (LabelEnd(views.plan, found.labels[i]) - start).normalized();
    EXPECT_LT(std::abs(Cross(along, middle - start)), 0.05);
  }
  EXPECT_NEAR(found.matched_length_m, length, 1e-9);
}

TEST(ScanLocator, WhatStandsInTheWayHidesWalls) {
  const Views views = PlanOf(OddRoom());
  int num_right = 0;
  for (int i = 0; i < 20; ++i) {
    Random random(i);
    const PlanarPose pose{{random.Uniform(2.3, 3.8), 2.5}, random.Uniform(-3, 3)};
    RangeScan scan;
    scan.first_angle_rad = RadFromDeg(-90);
    scan.step_rad = RadFromDeg(1);
    for (const Beam& beam : BeamsAt(views.plan.walls, pose, 0.01, &random))
      scan.ranges_m.push_back(beam.range_m);
    for (int k = 60; k < 105; ++k) scan.ranges_m[k] = std::min(scan.ranges_m[k], 0.4 + 0.003 * k);
    for (int k = 10; k < 20; ++k) scan.ranges_m[k] = 0;  // and some without a range
    const LocatedScan located = Located(views, ViewOf(scan, {}));
    num_right += !located.hypotheses.empty() && IsAt(located.hypotheses[0], pose) ? 1 : 0;
  }
  EXPECT_GE(num_right, 19);
}

TEST(ScanLocator, RoomsThatLookAlikeShareTheProbability) {
  std::vector<PlanWall> walls = OddRoom();
  for (const PlanWall& wall : OddRoom()) walls.push_back({wall.start + Vec2(20, 0), wall.end + Vec2(20, 0)});
  const Views views = PlanOf(walls);
  Random random(4);
  const PlanarPose pose{{3, 2.5}, 0.3};
  const LocatedScan located = Located(views, ScanAt(walls, pose, &random));
  ASSERT_GE(located.hypotheses.size(), 2u);
  const ScanHypothesis &a = located.hypotheses[0], &b = located.hypotheses[1];
  EXPECT_NEAR(a.probability + b.probability, 1, 0.05);
  EXPECT_NEAR(a.probability, 0.5, 0.2);
  EXPECT_NEAR(std::abs(a.pose.position.x() - b.pose.position.x()), 20, 0.05);
  EXPECT_TRUE(a.determined);
  EXPECT_TRUE(b.determined);
}

TEST(ScanLocator, InACorridorThePlaceAlongItIsNotKnown) {
  // Whatever its length, it may be either way round: 0.8 m from one wall, or 1.2 m from the other.
  for (const double length : {45.0, 60.0, 90.0}) {
    const std::vector<PlanWall> walls = {{{0, 0}, {length, 0}}, {{length, 2}, {0, 2}}};
    const Views views = PlanOf(walls);
    Random random(4);
    const PlanarPose pose{{length / 2, 0.8}, 0};
    const LocatedScan located = Located(views, ScanAt(walls, pose, &random));
    ASSERT_EQ(located.hypotheses.size(), 2u) << length;
    for (const ScanHypothesis& found : located.hypotheses) {
      EXPECT_FALSE(found.determined);
      EXPECT_NEAR(found.probability, 0.5, 0.1) << length;
      // All places from which at least most of 20 m of both walls ahead are seen.
      EXPECT_GT(std::sqrt(found.covariance(0, 0)), (length - 20) / std::sqrt(12.0));
      EXPECT_LT(std::sqrt(found.covariance(0, 0)), length / std::sqrt(12.0));
      EXPECT_LT(std::sqrt(found.covariance(1, 1)), 0.2);
      // In their middle.
      const bool is_ahead = std::abs(WrapAngle(found.pose.heading_rad)) < 1;
      const double along = is_ahead ? found.pose.position.x() : length - found.pose.position.x();
      EXPECT_GT(along, (length - 20) / 2 - 1);
      EXPECT_LT(along, length / 2 + 1);
      EXPECT_NEAR(found.pose.position.y(), std::abs(WrapAngle(found.pose.heading_rad)) < 1 ? 0.8 : 1.2, 0.05);
    }
  }
}

TEST(ScanLocator, CorridorsInOneLineAreTwo) {
  const std::vector<PlanWall> walls = {
      {{0, 0}, {30, 0}}, {{30, 2}, {0, 2}}, {{100, 0}, {130, 0}}, {{130, 2}, {100, 2}}};
  Random random(4);
  const LocatedScan located = Located(PlanOf(walls), ScanAt(walls, {{8, 1}, 0}, &random));
  int num_left = 0, num_right = 0;
  for (const ScanHypothesis& found : located.hypotheses)
    ++(found.pose.position.x() < 50 ? num_left : num_right);
  EXPECT_GE(num_left, 1);
  EXPECT_GE(num_right, 1);
}

TEST(ScanLocator, SaysWhereThereMayBeMorePlaces) {
  // 64 rooms that are the same.
  std::vector<PlanWall> walls;
  for (int i = 0; i < 64; ++i) {
    const Vec2 corner(12.0 * (i % 8), 9.0 * (i / 8));
    for (const PlanWall& wall : OddRoom()) walls.push_back({wall.start + corner, wall.end + corner});
  }
  Random random(4);
  const LocatedScan located = Located(PlanOf(walls), ScanAt(walls, {{27, 20.5}, 0.3}, &random));
  EXPECT_FALSE(located.complete);
  EXPECT_GT(located.hypotheses.size(), 20u);
}

TEST(ScanLocator, AScanOfAPlaceThatThePlanDoesNotShowIsNotBelieved) {
  const Views views = PlanOf(OddRoom());
  // Of a hall that is larger than all of it.
  ScanView scan;
  for (int degree = -90; degree < 90; ++degree)
    scan.beams.push_back(
        {{std::cos(RadFromDeg(degree)), std::sin(RadFromDeg(degree))},
         10 / std::max(std::abs(std::cos(RadFromDeg(degree))), std::abs(std::sin(RadFromDeg(degree)))),
         true});
  const LocatedScan located = Located(views, scan);
  double sum = 0;
  for (const ScanHypothesis& found : located.hypotheses) sum += found.probability;
  EXPECT_GT(sum, 0);
  EXPECT_LT(sum, 0.5);
}

TEST(ScanLocator, SegmentsAloneWillDo) {
  const Views views = PlanOf(OddRoom());
  Random random(9);
  const PlanarPose pose{{3.2, 1.4}, -0.8};
  ScanView scan = ScanAt(views.plan.walls, pose, &random);
  scan.beams = BeamsTo(scan.segments);
  const LocatedScan located = Located(views, scan);
  ASSERT_FALSE(located.hypotheses.empty());
  EXPECT_TRUE(IsAt(located.hypotheses[0], pose));
}

TEST(ScanLocator, PosesFromPairingsAreJudgedByBeamsToo) {
  const Views views = decompose_views::Decomposed(
                          "0,0,9,0\n9,0,9,6\n9,6,0,6\n0,6,0,0\n4,0,4,2\n4,3,4,6\n4,3.5,6,3.5\n7,3.5,9,3.5\n"
                          "2,6,2,5.5\n7.5,1,8.2,1.7\n")
                          .views;
  Random random(2);
  const PlanarPose pose{{2, 2.5}, 0.2};
  const ScanView scan = ScanAt(views.plan.walls, pose, &random);
  for (const char* search : {"vir", "standard", "beams"}) {
    const LocatedScan located = Located(views, scan, {.search = search});
    ASSERT_FALSE(located.hypotheses.empty()) << search;
    EXPECT_TRUE(IsAt(located.hypotheses[0], pose)) << search;
    EXPECT_GT(located.hypotheses[0].probability, 0.9) << search;
    EXPECT_GT(located.num_tried, 0) << search;
  }
}

TEST(ScanLocator, SaysTheSameEachTime) {
  const Views views = PlanOf(OddRoom());
  Random random(6);
  const ScanView scan = ScanAt(views.plan.walls, {{5, 2}, 2}, &random);
  const LocatedScan a = Located(views, scan), b = Located(views, scan);
  ASSERT_EQ(a.hypotheses.size(), b.hypotheses.size());
  for (size_t i = 0; i < a.hypotheses.size(); ++i) {
    EXPECT_EQ(a.hypotheses[i].pose.position, b.hypotheses[i].pose.position);
    EXPECT_EQ(a.hypotheses[i].probability, b.hypotheses[i].probability);
  }
}

TEST(ScanLocator, RefusesWhatItCannotUse) {
  const Views views = PlanOf(OddRoom());
  EXPECT_EQ(ScanLocator::Make(PlanOf({}), {}).error().code, ErrorCode::kNoData);
  EXPECT_THAT(ScanLocator::Make(views, {.search = "eyes"}).error().message, HasSubstr("search"));
  EXPECT_EQ(ScanLocator::Make(views, {.least_odds = 0}).error().code, ErrorCode::kInvalidArgument);
  const Views millimetres = PlanOf({{{0, 0}, {30000, 0}}, {{0, 0}, {0, 20000}}});
  EXPECT_THAT(ScanLocator::Make(millimetres, {}).error().message, HasSubstr("30000 x 20000 m"));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(ScanLocator::Make(PlanOf({{{-1e308, 0}, {1e308, 1e308}}}), {}).error().code,
            ErrorCode::kUnsupported);
  EXPECT_EQ(ScanLocator::Make(PlanOf({{{0, 0}, {kInfinity, 1}}}), {}).error().code, ErrorCode::kUnsupported);
  const auto locator = ScanLocator::Make(views, {});
  ScanView blind;
  EXPECT_EQ(locator->Locate(blind).error().code, ErrorCode::kNoData);
  for (int i = 0; i < 100; ++i) blind.beams.push_back({{1, 0}, 20, i < 2});
  EXPECT_THAT(locator->Locate(blind).error().message, HasSubstr("2 of 100 beams"));
  blind.beams[50].met = true;
  EXPECT_TRUE(locator->Locate(blind).ok());
}

// Of one place, which beams of five sectors met: its odds are those of the beams against a plan without
// walls, but for what the best of many poses explains by chance.
TEST(ScanLocator, ProbabilityIsByTheOddsAgainstAPlanWithoutWalls) {
  const Views views = PlanOf(OddRoom());
  const PlanarPose pose{{3, 2.5}, 0.3};
  Random random(1);
  const std::vector<Beam> all = BeamsAt(views.plan.walls, pose, 0, &random);
  for (const int num_each : {1, 4}) {
    ScanView scan;
    for (const int degree : {-82, -58, 1, 38, 74}) {
      for (int k = 0; k < num_each; ++k) {
        Beam beam = all[90 + degree + k];
        beam.range_m += 0.35 * (k % 2 == 0 ? 1 : -1);  // as in a place that is not quite the plan's
        scan.beams.push_back(beam);
      }
    }
    const auto located = ScanLocator::Make(views, {})->LocateNear(scan, std::span(&pose, 1));
    ASSERT_TRUE(located.ok());
    ASSERT_EQ(located->hypotheses.size(), 1U);
    const ScanHypothesis& found = located->hypotheses[0];
    const PlanRays rays(views.plan.walls);
    const BeamModel model(views.plan.walls, rays, {});
    const double evidence =
        (model.Weigh(scan.beams, found.pose).log_likelihood - model.WeighWithoutWalls(scan.beams)) / num_each;
    EXPECT_NEAR(found.probability, 1 / (1 + std::exp(3 - evidence)), 1e-9);
    EXPECT_LT(found.probability, 0.999);
  }
}

// One segment, 5 cm before its wall, among beams that say where the robot is.
TEST(ScanLocator, AMatchedSegmentIsSoFarFromItsWall) {
  const Views views = PlanOf(OddRoom());
  const PlanarPose pose{{4, 1.5}, 0};
  Random random(1);
  ScanView scan{.beams = BeamsAt(views.plan.walls, pose, 0, &random)};
  scan.segments = {{{-1, -1.45}, {1, -1.45}, 0.01, 0.01, 20}};
  const auto located = ScanLocator::Make(views, {})->LocateNear(scan, std::span(&pose, 1));
  const ScanHypothesis& found = located->hypotheses.at(0);
  EXPECT_EQ(found.num_matched, 1);
  EXPECT_NEAR(found.matched_length_m, 2, 1e-9);
  EXPECT_NEAR(found.rms_m, 0.05, 2e-3);
  scan.segments[0].start.y() = scan.segments[0].end.y() = -0.5;  // at no wall
  const auto without = ScanLocator::Make(views, {})->LocateNear(scan, std::span(&pose, 1));
  EXPECT_EQ(without->hypotheses.at(0).num_matched, 0);
  EXPECT_EQ(without->hypotheses.at(0).rms_m, 0);
}

TEST(ScanLocator, OptionsAreDescribedOnceAndHaveTheirRanges) {
  ScanLocatorOptions options;
  std::vector<std::string> names;
  for (const Option& option : DescribeOptions(&options)) names.push_back(option.name);
  EXPECT_EQ(std::count(names.begin(), names.end(), "search"), 1);
  EXPECT_EQ(std::count(names.begin(), names.end(), "first_only"), 0);
  EXPECT_EQ(std::count(names.begin(), names.end(), "max_null_ratio"), 1);
  EXPECT_EQ(std::count(names.begin(), names.end(), "sigma_wall_m"), 1);
  for (const auto& [least_odds, is_right] :
       {std::pair(1e-9, true), {0.9e-9, false}, {1.0, true}, {1.1, false}}) {
    options.least_odds = least_odds;
    EXPECT_EQ(CheckOptions(DescribeOptions(&options)).ok(), is_right) << least_odds;
  }
}

}  // namespace
}  // namespace cairn
