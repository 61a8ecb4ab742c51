#include "core/view_regions/nearby_plan.h"

#include <cmath>
#include <numbers>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/vector_geometry.h"
#include "core/plan/visible_walls.h"
#include "core/view_regions/derive_views.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn::decompose_views {
namespace {

using Vec2 = Eigen::Vector2d;

TEST(PlanNear, HasTheWallsWithinReachWhole) {
  const FloorPlan plan = Decomposed("0,0,20,0\n5,3,5,9\n18,2,19,2\n6,-4,6,4\n").views.plan;
  const std::vector<Vec2> places = {{1, 1}};
  const NearbyPlan near = PlanNear(plan, places, 4.5);
  ASSERT_EQ(near.walls.size(), 2u);
  for (size_t i = 0; i < near.walls.size(); ++i) {
    EXPECT_EQ(near.plan.walls[i].start, plan.walls[near.walls[i]].start);
    EXPECT_EQ(near.plan.walls[i].end, plan.walls[near.walls[i]].end);
  }
  EXPECT_FALSE(near.plan.closed);
  EXPECT_EQ(near.plan.grid_m, plan.grid_m);
  // The box has the walls, and what lies within reach in the plan's box: that of its walls and a metre.
  EXPECT_NEAR(near.plan.Metres(near.plan.low).x(), plan.Metres(plan.low).x(), 1e-4);
  EXPECT_NEAR(near.plan.Metres(near.plan.low).y(), -3.5, 1e-4);
  EXPECT_NEAR(near.plan.Metres(near.plan.high).x(), 20, 1e-4);
  EXPECT_NEAR(near.plan.Metres(near.plan.high).y(), 9, 1e-4);
  // At the limit, and beyond it.
  EXPECT_EQ(PlanNear(plan, places, 0.999).walls.size(), 0u);
  EXPECT_EQ(PlanNear(plan, places, 1.001).walls.size(), 1u);
  const std::vector<Vec2> two = {{1, 1}, {18.5, 2.5}};
  EXPECT_EQ(PlanNear(plan, two, 1.001).walls.size(), 2u);
  EXPECT_EQ(PlanNear(plan, two, 1e9).walls.size(), plan.walls.size());
  EXPECT_EQ(PlanNear(plan, two, 1e9).plan.low, plan.low);
  EXPECT_EQ(PlanNear(plan, two, 1e9).plan.high, plan.high);
}

// The first wall along a ray.
std::optional<int32_t> FirstWall(const FloorPlan& plan, const Vec2& from, const Vec2& direction,
                                 double reach) {
  std::optional<int32_t> first;
  double least = reach;
  for (int32_t i = 0; i < plan.num_walls(); ++i) {
    const Vec2 start = plan.walls[i].start - from, along = plan.walls[i].end - plan.walls[i].start;
    const double slant = Cross(direction, along);
    if (std::abs(slant) < 1e-9) continue;
    const double distance = Cross(start, along) / slant, share = Cross(start, direction) / slant;
    if (share < 0 || share > 1 || distance <= 0 || distance >= least) continue;
    least = distance;
    first = i;
  }
  return first;
}

TEST(PlanNear, WhatALaserSeesNearAPlaceIsWhatItSeesInTheWholePlan) {
  Random random(7);
  for (int trial = 0; trial < 5; ++trial) {
    std::string text;
    for (int i = 0; i < 40; ++i) {
      const Vec2 start(random.Uniform(0, 20), random.Uniform(0, 20));
      const double angle = random.Uniform(0, 2 * std::numbers::pi), length = random.Uniform(0.5, 3);
      text += fmt::format("{},{},{},{}\n", start.x(), start.y(), start.x() + length * std::cos(angle),
                          start.y() + length * std::sin(angle));
    }
    const FloorPlan plan = Decomposed(text).views.plan;
    const std::vector<Vec2> places = {{5, 6}, {13, 14}};
    const NearbyPlan near = PlanNear(plan, places, 4);
    ASSERT_LT(near.walls.size(), plan.walls.size());
    NoProgress progress;
    const auto derived = DeriveViews(near.plan, 1, 1024, progress);
    ASSERT_TRUE(derived.ok()) << derived.error().message;
    const FaceLocator locator(derived->views);
    int num_seen = 0;
    for (int i = 0; i < 400; ++i) {
      const Vec2 at = places[i % 2] + Vec2(random.Uniform(-0.7, 0.7), random.Uniform(-0.7, 0.7));
      const double angle = random.Uniform(0, 2 * std::numbers::pi);
      const Vec2 direction(std::cos(angle), std::sin(angle));
      const auto whole = FirstWall(plan, at, direction, 3);
      const auto part = FirstWall(near.plan, at, direction, 3);
      ASSERT_EQ(whole.has_value(), part.has_value());
      if (!whole) continue;
      ++num_seen;
      EXPECT_EQ(near.walls[*part], *whole);
      // It is among the labels of the region.
      const FaceIdx face = locator.Find(at);
      ASSERT_GE(face, 0);
      const std::vector<LabelIdx> labels = derived->views.LabelSet(face);
      EXPECT_TRUE(
          std::any_of(labels.begin(), labels.end(), [&](LabelIdx label) { return WallOf(label) == *part; }));
    }
    EXPECT_GT(num_seen, 30);
  }
}

}  // namespace
}  // namespace cairn::decompose_views
