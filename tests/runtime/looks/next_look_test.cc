#include "runtime/looks/next_look.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/blocks/map_head.h"
#include "core/blocks/map_rows.h"
#include "core/geometry/pose.h"
#include "runtime/looks/surveyed_looks.h"
#include "runtime/map/map.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::SizeIs;
using Vec2 = Eigen::Vector2d;

constexpr double kPi = std::numbers::pi;

Views Plan(const std::string& text) {
  Views views;
  views.plan = decompose_views::Decomposed(text).views.plan;
  return views;
}

PossiblePlace At(double x, double y, double heading_rad, double probability) {
  PossiblePlace place;
  place.pose = {{x, y}, heading_rad};
  place.probability = probability;
  return place;
}

// A closed corridor from x = 0 to `length`, 2 m wide, at y = `low` to `low + 2`.
std::string Corridor(double low, double length) {
  return fmt::format("0,{0},{1},{0}\n{1},{0},{1},{2}\n{1},{2},0,{2}\n0,{2},0,{0}\n", low, length, low + 2);
}

void ExpectFree(const PlanSpace& space, const NextLook& next, const PlanarPose& pose, double radius_m) {
  for (size_t i = 0; i + 1 < next.path.size(); ++i)
    EXPECT_TRUE(
        space.IsFree(pose.FloorFromRobot(next.path[i]), pose.FloorFromRobot(next.path[i + 1]), radius_m));
}

// Two elbows; only the right one's arm has a pillar, which is hidden from the lower ends.
const char* const kElbows =
    "0,0,0,5\n0,5,4,5\n4,5,4,4\n4,4,1,4\n1,4,1,0\n1,0,0,0\n"
    "10,0,10,5\n10,5,14,5\n14,5,14,4\n14,4,11,4\n11,4,11,0\n11,0,10,0\n13,4.1,13,4.9\n";

TEST(NextLook, IsAroundTheCornerBehindWhichPlacesDiffer) {
  const Views views = Plan(kElbows);
  const PlanSpace space(views);
  // The second stands turned to the left: a motion is the robot's own.
  const std::vector<PossiblePlace> places = {At(0.5, 0.5, kPi / 2, 0.6), At(10.5, 0.5, kPi / 2, 0.4)};
  const auto next = PlanNextLook(space, places, nullptr, {.radius_m = 0.1}, 1);
  ASSERT_TRUE(next.ok()) << next.error().message;
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(next->hypotheses, ElementsAre(0, 1));
  EXPECT_THAT(next->left, ElementsAre(ElementsAre(0), ElementsAre(1)));
  EXPECT_THAT(next->alike, IsEmpty());
  EXPECT_EQ(next->path.front(), Vec2(0, 0));
  // Ahead, up to where the pillar comes into view: the corner hides it from below the line from its lower
  // end.
  EXPECT_GT(next->path.back().x(), 2.5);
  EXPECT_LT(next->path.back().x(), 4.5);
  EXPECT_DOUBLE_EQ(next->expected_length_m, next->length_m);
  for (const PossiblePlace& place : places) ExpectFree(space, *next, place.pose, 0.1);
}

TEST(NextLook, PosesTurnedAgainstEachOtherMoveInTheirOwnFrames) {
  // The right elbow turned by a quarter, to the left of everything.
  const Views straight = Plan(kElbows);
  std::string turned;
  for (const PlanWall& wall : straight.plan.walls) {
    const auto moved = [](const Vec2& point) {
      return point.x() < 9 ? point : Vec2(-10 - point.y(), point.x() - 10);
    };
    turned += fmt::format("{},{},{},{}\n", moved(wall.start).x(), moved(wall.start).y(), moved(wall.end).x(),
                          moved(wall.end).y());
  }
  const Views views = Plan(turned);
  const PlanSpace space(views);
  const std::vector<PossiblePlace> places = {At(0.5, 0.5, kPi / 2, 0.6), At(-10.5, 0.5, kPi, 0.4)};
  const PlanSpace straight_space(straight);
  const auto next = PlanNextLook(space, places, nullptr, {.radius_m = 0.1}, 1),
             same = PlanNextLook(
                 straight_space,
                 std::vector<PossiblePlace>{At(0.5, 0.5, kPi / 2, 0.6), At(10.5, 0.5, kPi / 2, 0.4)}, nullptr,
                 {.radius_m = 0.1}, 1);
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  EXPECT_NEAR(next->length_m, same->length_m, 1e-9);
  for (const PossiblePlace& place : places) ExpectFree(space, *next, place.pose, 0.1);
}

// Corridors that end 6, 8 and 11 m ahead of the robot, whose laser sees 4 m.
class Corridors : public testing::Test {
 protected:
  const Views views_ = Plan(Corridor(0, 14) + Corridor(10, 16) + Corridor(20, 19));
  const PlanSpace space_{views_};
  const NextLookOptions options_{.view_range_m = 4, .same_range_m = 0.3, .step_m = 0.25};
  std::vector<PossiblePlace> Places(double first, double second, double third) const {
    return {At(8, 1, 0, first), At(8, 11, 0, second), At(8, 21, 0, third)};
  }
};

TEST_F(Corridors, OneEndAfterTheOtherComesIntoView) {
  const auto next = PlanNextLook(space_, Places(0.5, 0.3, 0.2), nullptr, options_, 1);
  ASSERT_TRUE(next.ok()) << next.error().message;
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  // The first end is seen after some 2 m; the second, in the half of the cases that are left, after 4: the
  // mean of 2, 4 and 4 m by their probabilities.
  EXPECT_NEAR(next->path.back().x(), 2.2, 0.4);
  EXPECT_NEAR(next->path.back().y(), 0, 0.5);
  EXPECT_NEAR(next->expected_length_m, 0.5 * 2.2 + 0.5 * 4.2, 0.5);
  EXPECT_THAT(next->left, ElementsAre(ElementsAre(0), ElementsAre(1, 2), ElementsAre(1, 2)));
  EXPECT_THAT(next->alike, IsEmpty());
}

TEST_F(Corridors, TheOrderOfThePlacesIsTheirs) {
  const auto next = PlanNextLook(space_, Places(0.2, 0.3, 0.5), nullptr, options_, 1);
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(next->hypotheses, ElementsAre(2, 1, 0));
  EXPECT_THAT(next->left, ElementsAre(ElementsAre(0, 1), ElementsAre(0, 1), ElementsAre(2)));
}

TEST_F(Corridors, ImprobablePlacesAreLeftOut) {
  const auto next = PlanNextLook(space_, Places(0.6, 0.005, 0.395), nullptr, options_, 1);
  EXPECT_THAT(next->hypotheses, ElementsAre(0, 2));
  // Just probable enough; and not probable at all.
  EXPECT_THAT(PlanNextLook(space_, Places(0.6, 0.01, 0.39), nullptr, options_, 1)->hypotheses,
              ElementsAre(0, 2, 1));
  EXPECT_THAT(PlanNextLook(space_, Places(0.5, 0, 0.5), nullptr,
                           {.view_range_m = 4, .step_m = 0.25, .least_probability = 0}, 1)
                  ->hypotheses,
              ElementsAre(0, 2));
  const auto few = PlanNextLook(space_, Places(0.5, 0.3, 0.2), nullptr,
                                {.view_range_m = 4, .step_m = 0.25, .max_num_hypotheses = 2}, 1);
  EXPECT_THAT(few->hypotheses, ElementsAre(0, 1));
  const auto one = PlanNextLook(space_, Places(0.995, 0.005, 0), nullptr, options_, 1);
  EXPECT_EQ(one->outcome, NextLookOutcome::kOnePlace);
  EXPECT_THAT(one->hypotheses, ElementsAre(0));
}

TEST_F(Corridors, AreToldApartInReachOnly) {
  NextLookOptions options = options_;
  options.reach_m = 1.5;
  const auto next = PlanNextLook(space_, Places(0.5, 0.3, 0.2), nullptr, options, 1);
  ASSERT_TRUE(next.ok());
  EXPECT_EQ(next->outcome, NextLookOutcome::kOutOfReach);
  EXPECT_THAT(next->alike, ElementsAre(Pair(0, 1), Pair(0, 2), Pair(1, 2)));
  EXPECT_THAT(next->path, ElementsAre(Vec2(0, 0)));
  // Only the first is told from the others: what is beyond is not said to be alike for good.
  options.reach_m = 2.75;
  const auto nearer = PlanNextLook(space_, Places(0.5, 0.3, 0.2), nullptr, options, 1);
  EXPECT_EQ(nearer->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(nearer->alike, ElementsAre(Pair(1, 2)));
}

// A place that is not known along a corridor: at one end or the other, the corridor says which.
TEST_F(Corridors, APlaceThatIsNotDeterminedIsSeveral) {
  PossiblePlace along = At(7, 1, 0, 1);
  along.covariance.diagonal() << 1.5 * 1.5, 0.01, 1e-4;
  const auto next = PlanNextLook(space_, std::vector<PossiblePlace>{along}, nullptr, options_, 1);
  ASSERT_TRUE(next.ok()) << next.error().message;
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(next->hypotheses, ElementsAre(0, 0, 0, 0, 0));
  ASSERT_THAT(next->places, SizeIs(5));
  double sum = 0;
  for (const PossiblePlace& place : next->places) {
    sum += place.probability;
    EXPECT_NEAR(place.pose.position.y(), 1, 1e-9);
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_NEAR(std::abs(next->places[1].pose.position.x() - 7), 0.75 * 1.5, 1e-9);
  EXPECT_NEAR(std::abs(next->places[3].pose.position.x() - 7), 1.5 * 1.5, 1e-9);
  EXPECT_NEAR(next->places[3].probability / next->places[0].probability, std::exp(-0.5 * 1.5 * 1.5), 1e-9);
  EXPECT_NEAR(next->places[1].probability / next->places[0].probability, std::exp(-0.5 * 0.75 * 0.75), 1e-9);
  EXPECT_NEAR(next->places[2].probability, next->places[1].probability, 1e-12);
  EXPECT_NEAR(next->places[1].pose.position.x() + next->places[2].pose.position.x(), 2 * 7, 1e-9);
  // An end is in view from the outermost place after 0.75 m along the corridor, from all others of one half
  // after 3.75 m.
  EXPECT_GT(std::abs(next->path.back().x()), 0.7);
  EXPECT_LT(std::abs(next->path.back().x()), 3.8);
  EXPECT_NEAR(next->path.back().y(), 0, 0.6);
  const auto outermost = next->path.back().x() > 0 ? size_t{4} : size_t{3};
  const bool is_turned = next->places[4].pose.position.x() < 7;
  EXPECT_THAT(next->left[is_turned ? 7 - outermost : outermost], SizeIs(1));
  // Turned, the heading goes with the place.
  along.covariance(0, 2) = along.covariance(2, 0) = 0.01;
  const auto turned = PlanNextLook(space_, std::vector<PossiblePlace>{along}, nullptr, options_, 1);
  for (const PossiblePlace& place : turned->places)
    EXPECT_NEAR(place.pose.heading_rad, 0.01 / (1.5 * 1.5) * (place.pose.position.x() - 7), 1e-4);
}

TEST_F(Corridors, ThreadsChangeNothing) {
  const auto one = PlanNextLook(space_, Places(0.4, 0.35, 0.25), nullptr, options_, 1),
             two = PlanNextLook(space_, Places(0.4, 0.35, 0.25), nullptr, options_, 2);
  EXPECT_EQ(one->path, two->path);
  EXPECT_EQ(one->expected_length_m, two->expected_length_m);
  EXPECT_EQ(one->left, two->left);
}

TEST_F(Corridors, TheExpectedWayIsTheMeanOverThePlaces) {
  // All ends look the same from as far away: the second comes into view 2 m after the first, where that was
  // not the robot's.
  const auto next = PlanNextLook(space_, Places(0.5, 0.3, 0.2), nullptr, options_, 1);
  EXPECT_NEAR(next->expected_length_m - next->length_m, (0.3 + 0.2) * 2, 0.05);
  const auto other = PlanNextLook(space_, Places(0.7, 0.2, 0.1), nullptr, options_, 1);
  EXPECT_NEAR(other->expected_length_m - other->length_m, (0.2 + 0.1) * 2, 0.05);
}

TEST_F(Corridors, WhatIsRefusedIsNamed) {
  const auto message = [&](const std::vector<PossiblePlace>& places) {
    return PlanNextLook(space_, places, nullptr, options_, 1).error().message;
  };
  EXPECT_THAT(message({At(8, 1, 0, 0.5), At(NAN, 11, 0, 0.5)}), HasSubstr("place 2 of 2"));
  EXPECT_THAT(message({At(8, 1, 0, 0.5), At(8, 11, 0, -0.1), At(8, 11, 0, 0.5)}), HasSubstr("place 2 of 3"));
  EXPECT_THAT(message({At(8, 1, 0, 0.001), At(8, 11, 0, 0)}),
              HasSubstr("none of 2 places has a probability of 0.01"));
  EXPECT_THAT(message({At(8, 2, 0, 0.4), At(8, 100, 0, 0.6)}), HasSubstr("no robot stands at (8, 100)"));
}

TEST_F(Corridors, BadPlacesAreRefused) {
  const auto code = [&](const std::vector<PossiblePlace>& places) {
    const auto next = PlanNextLook(space_, places, nullptr, options_, 1);
    return next.ok() ? ErrorCode::kFailed : next.error().code;
  };
  EXPECT_EQ(code({}), ErrorCode::kNoData);
  EXPECT_EQ(code({At(8, 1, 0, 0), At(8, 11, 0, 0)}), ErrorCode::kNoData);
  EXPECT_EQ(code({At(8, 1, 0, 0.5), At(NAN, 11, 0, 0.5)}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({At(8, 1, 0, 0.5), At(8, 11, INFINITY, 0.5)}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({At(8, 1, 0, 0.5), At(8, 11, 0, NAN)}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({At(8, 1, 0, 0.5), At(8, 11, 0, -0.5)}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code({At(8, 2, 0, 0.5), At(8, 100, 0, 0.5)}), ErrorCode::kNoData);  // on a wall, and outside
  // One of several that no robot stands at is left out.
  const auto one = PlanNextLook(space_, std::vector<PossiblePlace>{At(8, 2, 0, 0.5), At(8, 1, 0, 0.5)},
                                nullptr, options_, 1);
  EXPECT_EQ(one->outcome, NextLookOutcome::kOnePlace);
  EXPECT_THAT(one->hypotheses, ElementsAre(1));
  NextLookOptions options = options_;
  options.step_m = 0;
  EXPECT_EQ(PlanNextLook(space_, Places(0.4, 0.35, 0.25), nullptr, options, 1).error().code,
            ErrorCode::kInvalidArgument);
}

// Two rooms that differ by a pillar in a corner; a half-view scan ahead does not show it.
TEST(NextLook, ATurnIsEnoughWhereADifferenceIsBehind) {
  const Views views = Plan(
      "0,0,4,0\n4,0,4,4\n4,4,0,4\n0,4,0,0\n10,0,14,0\n14,0,14,4\n14,4,10,4\n10,4,10,0\n10.5,1.5,10.5,2.5");
  const PlanSpace space(views);
  const auto next =
      PlanNextLook(space, std::vector<PossiblePlace>{At(2, 2, 0, 0.5), At(12, 2, 0, 0.5)}, nullptr, {}, 1);
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(next->path, ElementsAre(Vec2(0, 0)));
  EXPECT_EQ(next->length_m, 0);
  EXPECT_NEAR(std::abs(next->heading_rad), kPi, 1e-9);
}

// What is free in one case only is not driven through: the second room has a wall across.
TEST(NextLook, NoWayLeadsThroughAWallOfAnyPlace) {
  const std::string rooms =
      "0,0,3,0\n3,0,3,12\n3,12,0,12\n0,12,0,0\n10,0,13,0\n13,0,13,12\n13,12,10,12\n10,12,10,0\n10,7,12,7\n";
  const Views views = Plan(rooms);
  const PlanSpace space(views);
  const std::vector<PossiblePlace> places = {At(1.5, 1, kPi / 2, 0.5), At(11.5, 1, kPi / 2, 0.5)};
  const auto next = PlanNextLook(space, places, nullptr, {.view_range_m = 4}, 1);
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  for (const PossiblePlace& place : places) ExpectFree(space, *next, place.pose, 0.2);
  EXPECT_LT(next->length_m, 4.5);
}

TEST(NextLook, RoomsThatAreTheSameAreSaidToBe) {
  const std::string room =
      "0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n0,2,2,2\n10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0\n10,2,12,2";
  const Views views = Plan(room);
  const PlanSpace space(views);
  const auto next =
      PlanNextLook(space, std::vector<PossiblePlace>{At(1, 1, 0, 0.5), At(11, 1, 0, 0.5)}, nullptr, {}, 1);
  ASSERT_TRUE(next.ok());
  EXPECT_EQ(next->outcome, NextLookOutcome::kAlike);
  EXPECT_THAT(next->alike, ElementsAre(Pair(0, 1)));
  EXPECT_THAT(next->left, ElementsAre(ElementsAre(0, 1), ElementsAre(0, 1)));
  EXPECT_GT(next->num_looks, 10);
  // A third that differs: what can be told is.
  const Views three = Plan(room + "\n20,0,29,0\n29,0,29,9\n29,9,20,9\n20,9,20,0");
  const PlanSpace space_of_three(three);
  const auto of_three = PlanNextLook(
      space_of_three, std::vector<PossiblePlace>{At(1, 1, 0, 0.4), At(11, 1, 0, 0.4), At(21, 1, 0, 0.2)},
      nullptr, {}, 1);
  ASSERT_EQ(of_three->outcome, NextLookOutcome::kFound);
  EXPECT_THAT(of_three->alike, ElementsAre(Pair(0, 1)));
  EXPECT_THAT(of_three->left, ElementsAre(ElementsAre(0, 1), ElementsAre(0, 1), ElementsAre(2)));
}

TEST(NextLook, ARobotNearAWallMoves) {
  const Views views = Plan(kElbows);
  const PlanSpace space(views);
  // 5 cm from a wall, with a radius of 20 cm.
  const auto next = PlanNextLook(
      space, std::vector<PossiblePlace>{At(0.05, 0.5, kPi / 2, 0.6), At(10.05, 0.5, kPi / 2, 0.4)}, nullptr,
      {}, 1);
  ASSERT_TRUE(next.ok()) << next.error().message;
  EXPECT_EQ(next->outcome, NextLookOutcome::kFound);
  // It keeps nine tenths of its distance.
  for (const double x : {0.05, 10.05}) ExpectFree(space, *next, {{x, 0.5}, kPi / 2}, 0.9 * 0.05 - 1e-6);
}

// A room of 10 m x 10 m around (5, 5), and the same 20 m to the right of it with a pillar 3 m from its
// middle, between two angles in a direction from it.  Robots stand in the middles, turned a little.
class EmptyRoomAndOneWithAPillar : public testing::Test {
 protected:
  static constexpr double kHeading = 0.3;
  static constexpr double kSpacingDeg = 360.0 / 192;  // of the beams that are compared
  NextLook Looked(double direction, double right_deg, double left_deg, const NextLookOptions& options) const {
    std::string text =
        "0,0,10,0\n10,0,10,10\n10,10,0,10\n0,10,0,0\n20,0,30,0\n30,0,30,10\n30,10,20,10\n20,10,20,0\n";
    if (left_deg > right_deg) {
      const auto end = [&](double deg) {
        return Vec2(Vec2(25, 5) +
                    Eigen::Rotation2Dd(kHeading + direction) * Vec2(3, 3 * std::tan(RadFromDeg(deg))));
      };
      text += fmt::format("{},{},{},{}\n", end(right_deg).x(), end(right_deg).y(), end(left_deg).x(),
                          end(left_deg).y());
    }
    const Views views = Plan(text);
    const PlanSpace space(views);
    const auto next =
        PlanNextLook(space, std::vector<PossiblePlace>{At(5, 5, kHeading, 0.5), At(25, 5, kHeading, 0.5)},
                     nullptr, options, 1);
    EXPECT_TRUE(next.ok()) << next.error().message;
    return next.ok() ? *next : NextLook{};
  }
};

TEST_F(EmptyRoomAndOneWithAPillar, AreToldApartByBeamsEnough) {
  // Without a step.  Each beam on the pillar is nearer than all of the other room, and those between two such
  // beams are farther: of five beams 5 + 3, of four 4 + 2.  One counts as an eighth of 4 * 30 / 192 * 4, and
  // 2 are enough: 7 beams.
  const NextLookOptions stays{.reach_m = 0.1};
  const double half = kSpacingDeg / 2;
  const NextLook five = Looked(0, -5 * half, 5 * half, stays);
  EXPECT_EQ(five.outcome, NextLookOutcome::kFound);
  EXPECT_THAT(five.left, ElementsAre(ElementsAre(0), ElementsAre(1)));
  EXPECT_EQ(five.num_looks, 1);
  EXPECT_EQ(Looked(0, -3 * half, 5 * half, stays).outcome, NextLookOutcome::kOutOfReach);
  EXPECT_EQ(Looked(0, -5 * half, 3 * half, stays).outcome, NextLookOutcome::kOutOfReach);
}

TEST_F(EmptyRoomAndOneWithAPillar, AreToldApartByALookAtThePillar) {
  for (int eighth = 0; eighth < 8; ++eighth) {
    const double direction = eighth * kPi / 4;
    SCOPED_TRACE(eighth);
    // With a narrow view there is but one such look, with a wide one it is the one with the pillar ahead.
    for (const double view_deg : {12.0, 180.0}) {
      const NextLook next = Looked(direction, -4.7, 4.7, {.view_deg = view_deg, .reach_m = 0.1});
      ASSERT_EQ(next.outcome, NextLookOutcome::kFound) << view_deg;
      EXPECT_NEAR(std::remainder(next.heading_rad - direction, 2 * kPi), 0, 1e-9) << view_deg;
      EXPECT_THAT(next.path, ElementsAre(Vec2(0, 0)));
      EXPECT_EQ(next.expected_length_m, 0);
    }
  }
  // Between two looks a narrow view misses it; half a turn is seen by turning.
  EXPECT_EQ(Looked(kPi / 8, -4.7, 4.7, {.view_deg = 12, .reach_m = 0.1}).outcome,
            NextLookOutcome::kOutOfReach);
  EXPECT_EQ(Looked(kPi / 8, -4.7, 4.7, {.view_deg = 60, .reach_m = 0.1}).outcome, NextLookOutcome::kFound);
}

TEST_F(EmptyRoomAndOneWithAPillar, AreLookedAtFromALatticeWithinReach) {
  // No pillar: all looks are compared.
  //        o
  //      o o o        Ways of 1 m in steps of 0.5 m and of 0.71 m.
  //    o o + o o
  //      o o o
  //        o
  const NextLook near = Looked(0, 0, 0, {.step_m = 0.5, .reach_m = 1});
  EXPECT_EQ(near.outcome, NextLookOutcome::kOutOfReach);
  EXPECT_EQ(near.num_looks, 13);
  // With (2, 1) and the like, to which no step leads straight.
  EXPECT_EQ(Looked(0, 0, 0, {.step_m = 0.5, .reach_m = 1.15}).num_looks, 13);
  EXPECT_EQ(Looked(0, 0, 0, {.step_m = 0.5, .reach_m = 1.25}).num_looks, 21);
  // The whole room but for what is nearer to a wall than the robot's radius; turned by 0.3.
  const double radius = 0.2;
  const NextLook all = Looked(0, 0, 0, {.radius_m = radius, .step_m = 0.5});
  EXPECT_EQ(all.outcome, NextLookOutcome::kAlike);
  int num_inside = 0;
  for (int row = -20; row <= 20; ++row) {
    for (int column = -20; column <= 20; ++column)
      num_inside +=
          (Eigen::Rotation2Dd(kHeading) * (0.5 * Vec2(column, row))).cwiseAbs().maxCoeff() <= 5 - radius;
  }
  EXPECT_EQ(all.num_looks, num_inside);
}

TEST(NextLook, OfAsManyPlacesAsASetHolds) {
  const Views views = Plan("0,0,20,0\n20,0,20,2\n20,2,0,2\n0,2,0,0");
  const PlanSpace space(views);
  const NextLookOptions options{.reach_m = 0.1, .least_probability = 0, .max_num_hypotheses = 64};
  std::vector<PossiblePlace> places;
  for (int i = 0; i < 70; ++i) places.push_back(At(1 + 0.25 * i, 1, 0, 1 + (i == 69 ? 1 : 0)));
  const auto next = PlanNextLook(space, places, nullptr, options, 1);
  ASSERT_TRUE(next.ok()) << next.error().message;
  EXPECT_EQ(next->outcome, NextLookOutcome::kFound);
  ASSERT_THAT(next->places, SizeIs(64));
  EXPECT_EQ(next->hypotheses[0], 69);
  EXPECT_EQ(next->hypotheses[63], 62);
  for (int i = 0; i < 64; ++i) {
    EXPECT_THAT(next->left[i], testing::Contains(i));
    EXPECT_LT(next->left[i].size(), 64u);
  }
  // Each of these is five places; the last one gets four.
  places.resize(13);
  for (PossiblePlace& place : places) place.covariance.diagonal() << 1, 0.01, 1e-4;
  const auto spread = PlanNextLook(space, places, nullptr, options, 1);
  ASSERT_THAT(spread->places, SizeIs(64));
  EXPECT_EQ(spread->hypotheses[63], 12);
}

TEST(NextLook, OptionsHaveTheirRanges) {
  NextLookOptions options;
  std::vector<std::pair<std::string, std::string>> ranges;
  for (const Option& option : DescribeOptions(&options)) ranges.emplace_back(option.name, ValuesText(option));
  EXPECT_THAT(ranges,
              ElementsAre(Pair("radius_m", "0 to 10"), Pair("view_range_m", "0.1 to 10000"),
                          Pair("view_deg", "1 to 360"), Pair("same_range_m", "0.001 to 10"),
                          Pair("step_m", "0.05 to 10"), Pair("reach_m", "0.1 to 1000"),
                          Pair("least_probability", "0 to 0.5"), Pair("max_num_hypotheses", "2 to 64")));
}

// A map of four images, two in each of two rooms: those along +x look alike, those turned from there do not.
std::shared_ptr<const Map> MapOfTwins(bool says_alike, double turn_rad = kPi / 2) {
  MapRows rows;
  Camera camera;
  camera.width = camera.height = 100;
  camera.params = {100, 50, 50};
  rows.cameras = {camera};
  for (int i = 0; i < 4; ++i) {
    const double x = i < 2 ? 1 : 11, heading = i % 2 == 0 ? 0 : turn_rad;
    Eigen::Matrix3d floor_from_cam;
    floor_from_cam << std::sin(heading), 0, std::cos(heading), -std::cos(heading), 0, std::sin(heading), 0,
        -1, 0;
    MapImage image;
    image.image_id = static_cast<ImageId>(i + 1);
    image.name = fmt::format("{}.png", i);
    image.camera_id = 1;
    image.cam_from_world = Pose{Eigen::Quaterniond(floor_from_cam), {x, 1, 1.2}}.Inverse();
    image.landmarks = {i % 2};
    rows.images.push_back(image);
    rows.appearance.push_back({.images = {i}, .is_kept = true});
  }
  rows.landmarks.resize(2);
  rows.descriptors = DescriptorMatrix::Zero(2, kSiftDescriptorDim);
  rows.descriptors.row(0).head(4).setConstant(255);
  rows.descriptors.row(1).tail(4).setConstant(255);
  if (says_alike) {
    for (MapAppearanceNode& node : rows.appearance) node.entropy = 0.5;
    rows.appearance[0].look_alikes = {{2, 0.9}};
  }
  auto map = Map::FromRows(std::move(rows));
  EXPECT_TRUE(map.ok()) << map.error().message;
  return map.ok() ? *map : nullptr;
}

TEST(SurveyedLooks, AreThoseOfTheNearestImage) {
  const auto map = MapOfTwins(true);
  ASSERT_NE(map, nullptr);
  const auto looks = SurveyedLooks::Make(*map, {});
  ASSERT_TRUE(looks.ok()) << looks.error().message;
  EXPECT_EQ(looks->PlaceAt({{1, 1}, 0}), 0);
  EXPECT_EQ(looks->PlaceAt({{1.9, 1}, 0}), 0);
  EXPECT_EQ(looks->PlaceAt({{2.1, 1}, 0}), -1);
  EXPECT_EQ(looks->PlaceAt({{-0.1, 1}, 0}), -1);
  EXPECT_EQ(looks->PlaceAt({{1, 2.1}, 0}), -1);
  EXPECT_EQ(looks->PlaceAt({{1, 1}, kPi / 2}), 1);
  EXPECT_EQ(looks->PlaceAt({{1, 1}, RadFromDeg(29)}), 0);
  EXPECT_EQ(looks->PlaceAt({{1, 1}, RadFromDeg(31)}), -1);
  EXPECT_EQ(looks->PlaceAt({{11, 1}, kPi / 2 - 2 * kPi}), 3);
  // Farther away and turned more count together.
  EXPECT_EQ(looks->PlaceAt({{1.7, 1}, RadFromDeg(20)}), 0);
  EXPECT_EQ(looks->PlaceAt({{1, 0.3}, RadFromDeg(-20)}), 0);
  EXPECT_EQ(looks->PlaceAt({{1.8, 1}, RadFromDeg(20)}), -1);
  EXPECT_EQ(looks->PlaceAt({{1, 1.8}, RadFromDeg(-20)}), -1);
  // Of two the nearer one, whichever comes first.
  const auto near = SurveyedLooks::Make(*MapOfTwins(true, RadFromDeg(20)), {});
  EXPECT_EQ(near->PlaceAt({{1, 1}, RadFromDeg(9)}), 0);
  EXPECT_EQ(near->PlaceAt({{1, 1}, RadFromDeg(11)}), 1);
  EXPECT_EQ(near->PlaceAt({{11, 1}, RadFromDeg(-9)}), 2);
  EXPECT_TRUE(looks->AreAlike(0, 2));
  EXPECT_TRUE(looks->AreAlike(1, 1));
  EXPECT_FALSE(looks->AreAlike(1, 3));
  // The laser 0.5 m behind the camera, and turned to its left: where that robot looks ahead, its camera looks
  // to the right.
  const auto mounted = SurveyedLooks::Make(*map, {{-0.5, 0}, kPi / 2});
  EXPECT_EQ(mounted->PlaceAt({{0.5, 1}, kPi / 2}), 0);
  EXPECT_EQ(mounted->PlaceAt({{-0.4, 1}, kPi / 2}), 0);
  EXPECT_EQ(mounted->PlaceAt({{-0.6, 1}, kPi / 2}), -1);
  EXPECT_EQ(SurveyedLooks::Make(*MapOfTwins(false), {}).error().code, ErrorCode::kNotFound);
}

TEST(NextLook, ACameraTellsRoomsApartThatALaserDoesNot) {
  const Views views = Plan("0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0");
  const PlanSpace space(views);
  const std::vector<PossiblePlace> places = {At(1.2, 1, 0, 0.5), At(11.2, 1, 0, 0.5)};
  EXPECT_EQ(PlanNextLook(space, places, nullptr, {}, 1)->outcome, NextLookOutcome::kAlike);
  const auto map = MapOfTwins(true);
  const auto images = SurveyedLooks::Make(*map, {});
  const auto next = PlanNextLook(space, places, &*images, {}, 1);
  ASSERT_EQ(next->outcome, NextLookOutcome::kFound);
  // It turns to the left: ahead, the rooms look alike.
  EXPECT_THAT(next->path, SizeIs(1));
  EXPECT_NEAR(next->heading_rad, kPi / 2, 1e-9);
  EXPECT_THAT(next->left, ElementsAre(ElementsAre(0), ElementsAre(1)));
}

}  // namespace
}  // namespace cairn
