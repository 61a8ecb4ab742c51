#include "runtime/paths/point_view.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// How far a ray from the origin gets, by trying all segments; infinity: nothing is in its way.
double NearestAlong(const std::vector<std::pair<Vec2, Vec2>>& segments, double angle) {
  const Vec2 direction(std::cos(angle), std::sin(angle));
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [start, end] : segments) {
    const Vec2 along = end - start;
    const double turn = Cross(direction, along);
    if (turn == 0) continue;
    const double share = Cross(start, direction) / turn, distance = Cross(start, along) / turn;
    if (share >= 0 && share <= 1 && distance > 0) nearest = std::min(nearest, distance);
  }
  return nearest;
}

TEST(PointView, HasTheNearestInEachDirection) {
  int num_hits = 0, num_misses = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    Random random(MixSeed(5, seed));
    std::vector<std::pair<Vec2, Vec2>> segments;
    std::vector<BlockedArc> arcs;
    const int num_segments = static_cast<int>(random.UniformInt(1, 12));
    for (int i = 0; i < num_segments; ++i) {
      // They cross; some share ends, some have whole coordinates.
      Vec2 start(random.Uniform(-5, 5), random.Uniform(-5, 5)),
          end(random.Uniform(-5, 5), random.Uniform(-5, 5));
      if (seed % 2 == 0) {
        start = start.array().round();
        end = end.array().round();
      }
      if (i > 0 && random.Uniform() < 0.4) start = segments.back().second;
      segments.emplace_back(start, end);
      AppendArcs(start, end, 0, 0, &arcs);
    }
    const std::vector<BlockedArc> view = NearestArcs(arcs);
    for (const BlockedArc& arc : view) EXPECT_LT(arc.from, arc.to);
    for (size_t i = 0; i + 1 < view.size(); ++i) {
      EXPECT_LE(view[i].to, view[i + 1].from);
      // What is seen of a segment without interruption is one arc.
      EXPECT_FALSE(view[i].to == view[i + 1].from && view[i].start == view[i + 1].start &&
                   view[i].end == view[i + 1].end);
    }
    for (int i = 0; i < 200; ++i) {
      const double angle = random.Uniform(-std::numbers::pi, std::numbers::pi);
      const auto arc = FirstArcFrom(view, angle);
      const bool is_hit = arc != view.end() && arc->from <= angle;
      const double expected = NearestAlong(segments, angle);
      ASSERT_EQ(is_hit, std::isfinite(expected)) << seed << " " << angle;
      (is_hit ? num_hits : num_misses) += 1;
      if (is_hit) EXPECT_NEAR(arc->Distance(angle), expected, 1e-9 * expected) << seed << " " << angle;
    }
  }
  EXPECT_GT(num_hits, 10000);
  EXPECT_GT(num_misses, 5000);
}

TEST(PointView, SegmentsThatShareAnEndLeaveNoGap) {
  // A ring of twelve segments, also across the direction pi.
  std::vector<BlockedArc> arcs;
  for (int i = 0; i < 12; ++i) {
    const auto corner = [](int k) {
      const double angle = 0.1 + k % 12 * std::numbers::pi / 6;
      return Vec2(3 * std::cos(angle), 3 * std::sin(angle));
    };
    AppendArcs(corner(i), corner(i + 1), 0, 0, &arcs);
  }
  const std::vector<BlockedArc> view = NearestArcs(arcs);
  EXPECT_EQ(view.front().from, -std::numbers::pi);
  EXPECT_EQ(view.back().to, std::numbers::pi);
  for (size_t i = 0; i + 1 < view.size(); ++i) EXPECT_EQ(view[i].to, view[i + 1].from);
}

TEST(PointView, OfTwoThatShareAnEndTheOneBeforeTheOtherIsSeen) {
  // From (2, 0) up to 45 degrees, or from there down: on the axis both are exactly as near.
  for (const double side : {1.0, -1.0}) {
    for (const bool near_first : {false, true}) {
      std::vector<BlockedArc> arcs;
      if (near_first) AppendArcs({2, 0}, {1, side}, 0, 0, &arcs);
      AppendArcs({2, 0}, {2, side * 2}, 0, 0, &arcs);
      if (!near_first) AppendArcs({2, 0}, {1, side}, 0, 0, &arcs);
      const std::vector<BlockedArc> view = NearestArcs(arcs);
      ASSERT_EQ(view.size(), 1u);
      EXPECT_NEAR(view[0].Distance(side * std::numbers::pi / 4), std::numbers::sqrt2, 1e-12);
    }
  }
}

TEST(PointView, WhereTwoCrossTheNearerOneChanges) {
  //  x = 2 upwards, and from (2.5, -0.4) to (1.5, 0.4) over (2, 0): the turn from one to the other is 1.
  for (const bool is_first : {false, true}) {
    std::vector<BlockedArc> arcs;
    if (is_first) AppendArcs({2, -0.5}, {2, 0.5}, 0, 0, &arcs);
    AppendArcs({2.5, -0.4}, {1.5, 0.4}, 0, 0, &arcs);
    if (!is_first) AppendArcs({2, -0.5}, {2, 0.5}, 0, 0, &arcs);
    const std::vector<BlockedArc> view = NearestArcs(arcs);
    ASSERT_EQ(view.size(), 2u);
    EXPECT_EQ(view[0].end, Vec2(2, 0.5));
    EXPECT_NEAR(view[0].to, 0, 1e-12);
    EXPECT_EQ(view[1].end, Vec2(1.5, 0.4));
  }
}

TEST(PointView, AnArcWithoutLengthIsNotSeen) {
  const BlockedArc none{-2, -2, {-1, -2}, {-1, -2}}, arc{1, 2, {1, 2}, {-1, 2}};
  EXPECT_EQ(NearestArcs({none, arc}).size(), 1u);
  EXPECT_EQ(NearestArcs({arc, none}).size(), 1u);
  EXPECT_EQ(NearestArcs({arc}).size(), 1u);
  EXPECT_TRUE(NearestArcs({}).empty());
}

TEST(PointView, ADirectionBetweenTwoArcsIsTheFirstOnes) {
  const std::vector<BlockedArc> view{{0, 1, {2, 0}, {1, 1}}, {1, 2, {1, 1}, {-1, 1}}};
  EXPECT_EQ(FirstArcFrom(view, 1), view.begin());
  EXPECT_EQ(FirstArcFrom(view, 1.01), view.begin() + 1);
  EXPECT_EQ(FirstArcFrom(view, -1), view.begin());
  EXPECT_EQ(FirstArcFrom(view, 2.01), view.end());
}

TEST(PointView, ASegmentThatEndsOrBeginsAtTheDirectionPiIsOneArc) {
  std::vector<BlockedArc> arcs;
  AppendArcs({0, 2}, {-2, 0}, 0, 0, &arcs);
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_EQ(arcs[0].to, std::numbers::pi);
  arcs.clear();
  AppendArcs({-2, 0}, {-2, -2}, 0, 0, &arcs);
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_EQ(arcs[0].from, -std::numbers::pi);
  EXPECT_EQ(arcs[0].to, -0.75 * std::numbers::pi);
}

TEST(PointView, WhatIsSparedAtAnEndIsFree) {
  std::vector<BlockedArc> arcs;
  // Clockwise or counter-clockwise: what is spared first is at the end that comes first counter-clockwise.
  AppendArcs({1, 1}, {1, -1}, 0.1, 0.2, &arcs);
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_NEAR(arcs[0].from, -std::numbers::pi / 4 + 0.1, 1e-12);
  EXPECT_NEAR(arcs[0].to, std::numbers::pi / 4 - 0.2, 1e-12);
  EXPECT_EQ(arcs[0].start, Vec2(1, -1));
  // Across the direction pi.
  arcs.clear();
  AppendArcs({-1, 1}, {-1, -1}, 0.1, 0.2, &arcs);
  ASSERT_EQ(arcs.size(), 2u);
  EXPECT_NEAR(arcs[0].from, 0.75 * std::numbers::pi + 0.1, 1e-12);
  EXPECT_NEAR(arcs[1].to, -0.75 * std::numbers::pi - 0.2, 1e-12);
  // At an end that lies just before the direction pi; the whole arc is then behind it.
  arcs.clear();
  AppendArcs({-1, 0.05}, {-1, -1}, 0.1, 0, &arcs);
  ASSERT_EQ(arcs.size(), 1u);
  EXPECT_NEAR(arcs[0].from, -std::numbers::pi - std::atan(0.05) + 0.1, 1e-12);
  EXPECT_EQ(arcs[0].to, -0.75 * std::numbers::pi);
  // Nothing is left, and what is in line with the place is not seen.
  arcs.clear();
  AppendArcs({1, 0.1}, {1, -0.1}, 0.1, 0.2, &arcs);
  AppendArcs({1, 1}, {2, 2}, 0, 0, &arcs);
  EXPECT_TRUE(arcs.empty());
}

}  // namespace
}  // namespace cairn
