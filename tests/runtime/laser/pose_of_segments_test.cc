// What segments paired with walls say about a pose: by hand, by the cost that a fit is the least of, and by
// trying points.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/laser/found_interpretations.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/laser/rank_interpretations.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// A room of 4 x 3 m, seen from inside.
FloorPlan SmallRoom() { return decompose_views::Decomposed("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0").views.plan; }

ScanSegment SegmentAt(const Vec2& start, const Vec2& end, const PlanarPose& pose, double sigma_angle = 1e-3,
                      double sigma_offset = 1e-3) {
  return {pose.RobotFromFloor(start), pose.RobotFromFloor(end), sigma_angle, sigma_offset, 10};
}

// Parts of the four walls, with errors in angle and offset as they state.
std::vector<ScanSegment> SeenParts(const FloorPlan& plan, const PlanarPose& pose, uint64_t seed) {
  Random random(seed);
  std::vector<ScanSegment> segments;
  for (const LabelIdx label : {0, 2, 4, 6}) {
    const Vec2 from = LabelStart(plan, label), along = LabelEnd(plan, label) - from;
    const Vec2 normal = Vec2(-along.y(), along.x()).normalized();
    const double sigma_angle = random.Uniform(0.005, 0.05), sigma_offset = random.Uniform(0.005, 0.05);
    const double turn = random.Normal(0, sigma_angle), off = random.Normal(0, sigma_offset);
    const Vec2 middle = from + 0.5 * along + off * normal;
    const Vec2 half = Eigen::Rotation2Dd(turn) * (0.2 * along);
    segments.push_back(SegmentAt(middle - half, middle + half, pose, sigma_angle, sigma_offset));
  }
  return segments;
}

// What a fit makes least: errors of angles, of middles beside the lines, and of ends beyond the walls' ends,
// each by its standard deviation.
double CostOf(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
              const std::vector<LabelIdx>& labels, const PlanarPose& pose) {
  double cost = 0;
  for (size_t i = 0; i < segments.size(); ++i) {
    if (labels[i] < 0) continue;
    const Vec2 start = LabelStart(plan, labels[i]), whole = LabelEnd(plan, labels[i]) - start,
               along = whole.normalized();
    const ScanSegment& seen = segments[i];
    cost += std::pow(
        WrapAngle(std::atan2(along.y(), along.x()) - seen.Angle() - pose.heading_rad) / seen.sigma_angle_rad,
        2);
    cost += std::pow(Cross(along, pose.FloorFromRobot(seen.Middle()) - start) / seen.sigma_offset_m, 2);
    for (const Vec2& end : {seen.start, seen.end}) {
      const double place = along.dot(pose.FloorFromRobot(end) - start);
      cost += std::pow((std::clamp(place, 0.0, whole.norm()) - place) / seen.sigma_end_m, 2);
    }
  }
  return cost;
}

void ExpectLeastCost(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                     const Interpretation& found) {
  const double least = CostOf(plan, segments, found.labels, found.pose);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step : {-1e-3, 1e-3}) {
      PlanarPose other = found.pose;
      if (axis < 2) other.position[axis] += step;
      if (axis == 2) other.heading_rad += step;
      EXPECT_GT(CostOf(plan, segments, found.labels, other), least) << axis << " " << step;
    }
  }
}

TEST(FitPose, IsThePoseOfLeastCost) {
  const FloorPlan plan = SmallRoom();
  for (int seed = 0; seed < 20; ++seed) {
    const PlanarPose pose{{1.7, 1.2}, 0.3 * seed - 3};
    const std::vector<ScanSegment> segments = SeenParts(plan, pose, seed);
    Interpretation found;
    found.labels = {0, 2, 4, 6};
    FitPose(plan, segments, &found);
    EXPECT_TRUE(found.determined);
    EXPECT_LT((found.pose.position - pose.position).norm(), 0.2);
    ExpectLeastCost(plan, segments, found);
    // A segment of no wall says nothing, wherever it stands among the others.
    const int without = seed % 4;
    found.labels[without] = -1;
    FitPose(plan, segments, &found);
    EXPECT_EQ(found.num_matched, 3);
    ExpectLeastCost(plan, segments, found);
    std::vector<ScanSegment> three = segments;
    three.erase(three.begin() + without);
    Interpretation of_three;
    of_three.labels = found.labels;
    of_three.labels.erase(of_three.labels.begin() + without);
    FitPose(plan, three, &of_three);
    EXPECT_LT((of_three.pose.position - found.pose.position).norm(), 1e-6);
    EXPECT_NEAR(of_three.matched_length_m, found.matched_length_m, 1e-12);
    EXPECT_NEAR(of_three.rms_m, found.rms_m, 1e-6);
  }
}

TEST(FitPose, IsOfLeastCostWhereEndsLieBeyondTheirWallsToo) {
  const FloorPlan plan = SmallRoom();
  const PlanarPose pose{{2.1, 1}, 0.7};
  // The whole of two opposite walls 3 cm to the right of them, and less of a third.
  std::vector<ScanSegment> segments = {SegmentAt({0.03, 0}, {4.03, 0}, pose, 0.01, 0.01),
                                       SegmentAt({4.03, 3}, {0.03, 3}, pose, 0.02, 0.02),
                                       SegmentAt({0, 2}, {0, 1}, pose, 0.01, 0.05)};
  Interpretation found;
  found.labels = {0, 4, 6};
  FitPose(plan, segments, &found);
  EXPECT_TRUE(found.determined);
  EXPECT_LT(found.pose.position.x(), pose.position.x() - 0.005);
  ExpectLeastCost(plan, segments, found);
}

// By the derivatives of what the segments' middles and angles are off.
TEST(FitPose, CovarianceIsTheInverseOfWhatThePairingsSay) {
  const FloorPlan plan = SmallRoom();
  const PlanarPose pose{{1.7, 1.2}, 0.4};
  const std::vector<ScanSegment> segments = {SegmentAt({0.5, 0}, {2, 0}, pose, 0.02, 0.03),
                                             SegmentAt({4, 0.5}, {4, 1}, pose, 0.01, 0.05),
                                             SegmentAt({1, 3}, {0.5, 3}, pose, 0.04, 0.01)};
  Interpretation found;
  found.labels = {0, 2, 4};
  FitPose(plan, segments, &found);
  EXPECT_LT((found.pose.position - pose.position).norm(), 1e-9);
  EXPECT_NEAR(found.pose.heading_rad, 0.4, 1e-9);
  EXPECT_NEAR(found.rms_m, 0, 1e-9);
  EXPECT_NEAR(found.matched_length_m, 2.5, 1e-12);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const Vec2 start = LabelStart(plan, found.labels[i]),
               along = (LabelEnd(plan, found.labels[i]) - start).normalized();
    const auto off = [&](const PlanarPose& at) {
      return Cross(along, at.FloorFromRobot(segments[i].Middle()) - start);
    };
    constexpr double kStep = 1e-5;
    Eigen::Vector3d row;
    for (int axis = 0; axis < 3; ++axis) {
      PlanarPose more = pose, less = pose;
      (axis < 2 ? more.position[axis] : more.heading_rad) += kStep;
      (axis < 2 ? less.position[axis] : less.heading_rad) -= kStep;
      row[axis] = (off(more) - off(less)) / (2 * kStep);
    }
    information += row * row.transpose() / std::pow(segments[i].sigma_offset_m, 2);
    information(2, 2) += 1 / std::pow(segments[i].sigma_angle_rad, 2);
  }
  EXPECT_TRUE(found.covariance.isApprox(information.inverse(), 1e-6));
}

// Along two parallel walls of 10 m and 8 m, of which 4 m are seen, the robot is somewhere on 6 m at most: in
// the middle of what the segments' middles say.
TEST(FitPose, AlongParallelWallsThePlaceIsTheMiddleOfItsRange) {
  const FloorPlan plan = decompose_views::Decomposed("0,0,10,0\n10,2,2,2").views.plan;
  const std::vector<ScanSegment> segments = {{{-1.5, -1.05}, {2.5, -1.05}, 1e-3, 1e-3, 10},
                                             {{2.5, 1.05}, {-1.5, 1.05}, 1e-3, 1e-3, 10}};
  Interpretation found;
  found.labels = {0, 2};
  FitPose(plan, segments, &found);
  EXPECT_FALSE(found.determined);
  EXPECT_NEAR(found.pose.position.x(), 5, 1e-6);
  EXPECT_NEAR(found.pose.position.y(), 1, 1e-6);
  EXPECT_NEAR(found.covariance(0, 0), 36, 1e-3);
  EXPECT_EQ(found.num_matched, 2);
  EXPECT_NEAR(found.matched_length_m, 8, 1e-12);
  EXPECT_NEAR(found.rms_m, 0.05, 1e-9);
  // No less than a metre, where all of a wall is seen.
  const FloorPlan little = decompose_views::Decomposed("0,0,4.2,0\n4.2,2,0,2").views.plan;
  FitPose(little, segments, &found);
  EXPECT_NEAR(found.covariance(0, 0), 1, 1e-3);
}

// Of two lines at an angle a, the information across is tan^2(a / 2) of that along: 1e-3 at 3.6 degrees.
TEST(FitPose, WallsThatAreNearlyParallelDoNotDetermineThePlace) {
  for (const auto& [turn_deg, is_determined] : {std::pair(3.4, false), {3.8, true}}) {
    const Vec2 along = Eigen::Rotation2Dd(RadFromDeg(turn_deg)) * Vec2(-10, 0);
    FloorPlan plan;
    plan.walls = {{{0, 0}, {10, 0}}, {Vec2(10, 2), Vec2(10, 2) + along}};
    const PlanarPose pose{{5, 1}, 0};
    const Vec2 middle = Vec2(10, 2) + 0.5 * along;
    Interpretation found;
    found.labels = {0, 2};
    FitPose(plan,
            {SegmentAt({3, 0}, {7, 0}, pose), SegmentAt(middle - 0.2 * along, middle + 0.2 * along, pose)},
            &found);
    EXPECT_EQ(found.determined, is_determined) << turn_deg;
  }
}

TEST(FitPose, WithoutAPairingThereIsNone) {
  Interpretation found;
  found.labels = {-1, -1};
  found.pose = {{7, 8}, 0.5};
  FitPose(SmallRoom(), {SegmentAt({1, 0}, {2, 0}, {}), SegmentAt({4, 1}, {4, 2}, {})}, &found);
  EXPECT_EQ(found.num_matched, 0);
  EXPECT_EQ(found.matched_length_m, 0);
  EXPECT_EQ(found.pose.position, Vec2(7, 8));
}

TEST(SquaredOffsets, IsTheSumOfBothEnds) {
  const FloorPlan plan = SmallRoom();
  const PlanarPose pose{{1, 1}, 0.3};
  EXPECT_NEAR(SquaredOffsets(plan, SegmentAt({1, 0.3}, {2, -0.4}, pose), 0, pose), 0.25, 1e-12);
  EXPECT_NEAR(SquaredOffsets(plan, SegmentAt({3.8, 1}, {4.1, 2}, pose), 2, pose), 0.05, 1e-12);
}

//            |
//   R        |   A       a wall of 2 m at x = 2; C lies on it but for 5 cm
//            C
TEST(SeesPoint, WhatNoWallStandsBefore) {
  FloorPlan plan;
  plan.walls = {{{2, -1}, {2, 1}}};
  const PlanarPose origin;
  EXPECT_FALSE(SeesPoint(plan, origin, {4, 0}, 0.1));
  EXPECT_FALSE(SeesPoint(plan, origin, {4, 1.9}, 0.1));
  EXPECT_TRUE(SeesPoint(plan, origin, {4, 2.1}, 0.1));
  EXPECT_FALSE(SeesPoint(plan, origin, {4, -1.9}, 0.1));
  EXPECT_TRUE(SeesPoint(plan, origin, {1.5, 0}, 0.1));
  EXPECT_TRUE(SeesPoint(plan, origin, {-4, 0}, 0.1)) << "a wall behind the robot";
  EXPECT_FALSE(SeesPoint(plan, origin, {2.2, 0}, 0.1));
  EXPECT_TRUE(SeesPoint(plan, origin, {2.2, 0}, 0.3)) << "no farther behind it than it may";
  // Seen along the wall, that is crossed 1.3 m before.
  EXPECT_TRUE(SeesPoint(plan, {{1.9, -3}, 0}, {2.05, 0.9}, 0.1));
  EXPECT_FALSE(SeesPoint(plan, {{1.9, -3}, 0}, {2.05, 0.9}, 0.01));
  // From the other side, by a robot elsewhere.
  EXPECT_FALSE(SeesPoint(plan, {{7, 5}, 1}, {1, -1}, 0.1));
  EXPECT_TRUE(SeesPoint(plan, {{7, 5}, 1}, {3, 1}, 0.1));
  // Other walls count as well.
  plan.walls.push_back({{-2, 1}, {-2, -1}});
  EXPECT_FALSE(SeesPoint(plan, origin, {-4, 0}, 0.1));
}

TEST(HiddenLength, IsThatOfTheEighthsBehindAWall) {
  FloorPlan plan;
  plan.walls = {{{2, 0}, {2, 1}}};
  // At 4 m the wall hides what lies from 0 to 2 m.
  const ScanSegment ahead{{4, -2}, {4, 2}};
  EXPECT_NEAR(HiddenLength(plan, {ahead}, {}, 0.1), 2, 1e-12);
  plan.walls[0].end.y() = 0.75;
  EXPECT_NEAR(HiddenLength(plan, {ahead}, {}, 0.1), 1.5, 1e-12);
  EXPECT_NEAR(HiddenLength(plan, {ahead, {{4, 1}, {4, 2}}, ahead}, {}, 0.1), 3 + 0.5, 1e-12);
  EXPECT_NEAR(HiddenLength(plan, {ahead}, {}, 2.1), 0, 1e-12);
  const PlanarPose turned{{0, 0}, std::numbers::pi};
  EXPECT_NEAR(HiddenLength(plan, {ahead}, turned, 0.1), 0, 1e-12);
}

class MisfitTest : public testing::Test {
 protected:
  // Of the segment at the pose, from the lower wall.
  double Of(const ScanSegment& segment) const {
    const std::vector<ScanSegment> segments = {segment};
    return FoundInterpretations(plan_, segments, options_).Misfit(found_, 0, 0);
  }

  FloorPlan plan_ = SmallRoom();
  InterpretationTreeOptions options_{
      .angle_tolerance_deg = 2, .position_tolerance_m = 0.1, .length_tolerance_m = 0.15, .num_sigmas = 2};
  Interpretation found_ = [] {
    Interpretation found;
    found.pose = {{2, 1}, 0};
    return found;
  }();
};

TEST_F(MisfitTest, IsTheLargestOfAngleOffsetAndEndsInUnitsOfWhatIsAllowed) {
  const auto seen = [](double x, double y, double turn_deg) {
    const Vec2 half = Eigen::Rotation2Dd(RadFromDeg(turn_deg)) * Vec2(1, 0);
    return ScanSegment{Vec2(x, y - 1) - half, Vec2(x, y - 1) + half, 0, 0, 10};
  };
  EXPECT_NEAR(Of(seen(0, 0, 0)), 0, 1e-12);
  EXPECT_NEAR(Of(seen(0, 0, 1)), 0.5, 1e-9);
  EXPECT_NEAR(Of(seen(0, 0.3, -4)), 2, 1e-9);
  EXPECT_NEAR(Of(seen(0, 0.05, 1)), 0.5, 1e-9);
  EXPECT_NEAR(Of(seen(0, 0.06, 1)), 0.6, 1e-9);
  EXPECT_NEAR(Of(seen(0, -0.3, 0)), 3, 1e-9);
  // It may end a metre from the middle of the wall's 4 m on either side.
  EXPECT_NEAR(Of(seen(1, 0, 0)), 0, 1e-9);
  EXPECT_NEAR(Of(seen(1.1, 0, 0)), 0.1 / 0.25, 1e-9);
  EXPECT_NEAR(Of(seen(-1.2, 0, 0)), 0.2 / 0.25, 1e-9);
  EXPECT_NEAR(Of(seen(-1.2, 0.09, 0)), 0.9, 1e-9);
}

TEST_F(MisfitTest, AllowsForWhatTheFitsDoNotKnow) {
  // Angles: 3 degrees of the segment and 4 of the pose are 5; twice that and 2 are 12.
  found_.covariance(2, 2) = std::pow(RadFromDeg(4), 2);
  const Vec2 half = Eigen::Rotation2Dd(RadFromDeg(6)) * Vec2(1, 0);
  EXPECT_NEAR(Of({Vec2(0, -1) - half, Vec2(0, -1) + half, RadFromDeg(3), 0, 10}), 0.5, 1e-9);
  // Offsets: 0.12 m of the place, 0.03 of the segment, 0.04 of the heading 1 m along the wall: 0.13.
  found_.covariance.diagonal() << 0, 0.12 * 0.12, 0.04 * 0.04;
  EXPECT_NEAR(Of({{0, -0.82}, {2, -0.82}, 0, 0.03, 10}), 0.18 / (2 * 0.13 + 0.1), 1e-9);
  // Ends: the same along it, where the heading counts by the distance of the wall.
  found_.covariance.diagonal() << 0.12 * 0.12, 0, 0.04 * 0.04;
  EXPECT_NEAR(Of({{1.2, -1}, {2.3, -1}, 0, 0.03, 10}), 0.3 / (2 * 0.13 + 0.1 + 0.15), 1e-9);
}

TEST(FoundInterpretations, ASegmentIsSeenWhereAPartOfItIs) {
  const FloorPlan plan =
      decompose_views::Decomposed("0,0,4,0\n4,0,4,3\n4,3,0,3\n0,3,0,0\n1,1,3,1").views.plan;
  Interpretation found;
  found.pose = {{2, 2}, 0};
  // The screen in the middle hides the lower wall; what lies beyond the left wall by less than may be is
  // seen, which is the outermost fifth of the last two.
  const std::vector<ScanSegment> segments = {
      SegmentAt({1, 0}, {3, 0}, found.pose), SegmentAt({0.1, 0}, {1, 0}, found.pose),
      SegmentAt({1.5, 3}, {2, 3}, found.pose), SegmentAt({-0.3, 0}, {2, 0}, found.pose),
      SegmentAt({2, 0}, {-0.3, 0}, found.pose)};
  const FoundInterpretations fits(plan, segments, {});
  EXPECT_FALSE(fits.IsSeen(found, 0));
  EXPECT_FALSE(fits.IsSeen(found, 1));
  EXPECT_TRUE(fits.IsSeen(found, 2));
  EXPECT_TRUE(fits.IsSeen(found, 3));
  EXPECT_TRUE(fits.IsSeen(found, 4));
}

// Two screens with a gap between them, before one fifth of a segment of 3 m each time.
TEST(FoundInterpretations, ASegmentIsSeenByAnyOfItsFifths) {
  Interpretation found;
  found.pose = {{2, 2}, 0};
  const std::vector<ScanSegment> segments = {SegmentAt({0.5, 0}, {3.5, 0}, found.pose)};
  for (const double gap : {1.4, 1.7, 2.0, 2.3, 2.6}) {
    FloorPlan plan = SmallRoom();
    plan.walls.push_back({{1, 1}, {gap - 0.1, 1}});
    plan.walls.push_back({{gap + 0.1, 1}, {3, 1}});
    EXPECT_TRUE(FoundInterpretations(plan, segments, {}).IsSeen(found, 0)) << gap;
    plan.walls.push_back({{gap - 0.1, 1}, {gap + 0.1, 1}});
    EXPECT_FALSE(FoundInterpretations(plan, segments, {}).IsSeen(found, 0)) << gap;
  }
}

TEST(FoundInterpretations, KeepsOneOfAPose) {
  const FloorPlan plan = SmallRoom();
  const PlanarPose pose{{1.5, 1}, 0.2};
  const std::vector<ScanSegment> segments = {SegmentAt({1, 0}, {3, 0}, pose), SegmentAt({4, 1}, {4, 2}, pose),
                                             SegmentAt({3, 3}, {1, 3}, pose),
                                             SegmentAt({2, 1.5}, {1.5, 1.9}, pose)};
  InterpretationTreeOptions options{.max_null_ratio = 0.5};
  FoundInterpretations found(plan, segments, options);
  EXPECT_FALSE(found.Add({0, -1, -1, -1})) << "more than half of no wall";
  EXPECT_TRUE(found.Add({0, 2, -1, -1}));
  EXPECT_TRUE(found.HasBoth(0, 0, 1, 2));
  EXPECT_FALSE(found.HasBoth(0, 0, 2, 4));
  EXPECT_FALSE(found.HasBoth(0, 2, 1, 2));
  // With more of its segments matched, it takes the place of the first; one that lies at no wall is removed.
  EXPECT_FALSE(found.Add({0, 2, 4, 6}));
  EXPECT_TRUE(found.HasBoth(0, 0, 2, 4));
  EXPECT_FALSE(found.Add({0, 2, -1, -1}));
  const std::vector<Interpretation> ranked = found.TakeRanked();
  ASSERT_EQ(ranked.size(), 1U);
  EXPECT_THAT(ranked[0].labels, testing::ElementsAre(0, 2, 4, -1));
  EXPECT_LT((ranked[0].pose.position - pose.position).norm(), 1e-6);
  EXPECT_NEAR(ranked[0].matched_length_m, 5, 1e-9);
}

TEST(FoundInterpretations, RemovesTheWorstPairingWhicheverItIs) {
  const FloorPlan plan = SmallRoom();
  const PlanarPose pose{{1.5, 1}, 0.2};
  const InterpretationTreeOptions options{.max_null_ratio = 0.25};
  std::vector<ScanSegment> segments = {SegmentAt({1, 0}, {3, 0}, pose), SegmentAt({4, 1}, {4, 2}, pose),
                                       SegmentAt({3, 3}, {1, 3}, pose)};
  std::vector<LabelIdx> labels = {0, 2, 4};
  for (const int at : {0, 2, 3}) {
    std::vector<ScanSegment> with_stray = segments;
    with_stray.insert(with_stray.begin() + at, SegmentAt({1, 1.7}, {0.6, 1.3}, pose));
    std::vector<LabelIdx> given = labels, expected = labels;
    given.insert(given.begin() + at, 6);
    expected.insert(expected.begin() + at, -1);
    FoundInterpretations found(plan, with_stray, options);
    EXPECT_TRUE(found.Add(given)) << at;
    EXPECT_EQ(found.TakeRanked().at(0).labels, expected);
  }
}

// A wall and another 5 cm behind it: of two interpretations of one pose the one that fits better.
TEST(FoundInterpretations, OfEqualLengthsTheBetterFitStays) {
  FloorPlan plan = SmallRoom();
  plan.walls.push_back({{4.05, 0}, {4.05, 3}});
  const PlanarPose pose{{1.5, 1}, 0.2};
  const std::vector<ScanSegment> segments = {SegmentAt({1, 0}, {3, 0}, pose), SegmentAt({4, 1}, {4, 2}, pose),
                                             SegmentAt({0, 2}, {0, 1}, pose)};
  const InterpretationTreeOptions options;
  for (const bool better_first : {false, true}) {
    FoundInterpretations found(plan, segments, options);
    EXPECT_TRUE(found.Add({0, better_first ? 2 : 8, 6}));
    EXPECT_FALSE(found.Add({0, better_first ? 8 : 2, 6}));
    EXPECT_TRUE(found.HasBoth(0, 0, 1, 2)) << better_first;
    EXPECT_FALSE(found.HasBoth(0, 0, 1, 8)) << better_first;
  }
}

// A corner, and the same turned about the robot: up to 4 degrees that is one pose.
TEST(FoundInterpretations, PosesAreTheSameWithinTwiceTheTolerance) {
  for (const auto& [turn_deg, is_same] : {std::pair(3.9, true), {4.1, false}, {-3.9, true}, {-4.1, false}}) {
    FloorPlan plan = SmallRoom();
    const Vec2 place(2, 1);
    const auto turned = [&](const Vec2& corner) {
      return Vec2(place + Eigen::Rotation2Dd(RadFromDeg(turn_deg)) * (corner - place));
    };
    plan.walls = {{{0, 0}, {4, 0}}, {{4, 0}, {4, 3}}};
    plan.walls.push_back({turned({0, 0}), turned({4, 0})});
    plan.walls.push_back({turned({4, 0}), turned({4, 3})});
    const PlanarPose pose{place, 0};
    const std::vector<ScanSegment> segments = {SegmentAt({1, 0}, {3, 0}, pose),
                                               SegmentAt({4, 1}, {4, 2}, pose)};
    FoundInterpretations found(plan, segments, {});
    EXPECT_TRUE(found.Add({0, 2}));
    EXPECT_EQ(found.Add({4, 6}), !is_same) << turn_deg;
  }
}

TEST(FoundInterpretations, APoseIsWithinThePlan) {
  const FloorPlan plan = SmallRoom();
  const Vec2 low = plan.Metres(plan.low), high = plan.Metres(plan.high);
  InterpretationTreeOptions options;
  options.position_tolerance_m = 0.1;
  for (const auto& [place, is_in] : {std::pair<Vec2, bool>{{3.9, 0.1}, true},
                                     {{high.x() + 0.09, 1}, true},
                                     {{high.x() + 0.11, 1}, false},
                                     {{2, low.y() - 0.09}, true},
                                     {{2, low.y() - 0.11}, false},
                                     {{2, high.y() + 0.09}, true},
                                     {{2, high.y() + 0.11}, false},
                                     {{low.x() - 0.09, 1}, true},
                                     {{low.x() - 0.11, 1}, false}}) {
    FloorPlan open = plan;
    open.walls = {{{0, -10}, {4, -10}}, {{20, 0}, {20, 3}}};  // seen from everywhere
    const PlanarPose pose{place, 0};
    const std::vector<ScanSegment> segments = {SegmentAt({1, -10}, {3, -10}, pose),
                                               SegmentAt({20, 1}, {20, 2}, pose)};
    FoundInterpretations found(open, segments, options);
    EXPECT_EQ(found.Add({0, 2}), is_in) << place.transpose();
  }
}

}  // namespace
}  // namespace cairn
