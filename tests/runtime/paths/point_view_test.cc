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
    for (size_t i = 0; i + 1 < view.size(); ++i) EXPECT_LE(view[i].to, view[i + 1].from);
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
  // Nothing is left, and what is in line with the place is not seen.
  arcs.clear();
  AppendArcs({1, 0.1}, {1, -0.1}, 0.1, 0.2, &arcs);
  AppendArcs({1, 1}, {2, 2}, 0, 0, &arcs);
  EXPECT_TRUE(arcs.empty());
}

}  // namespace
}  // namespace cairn
