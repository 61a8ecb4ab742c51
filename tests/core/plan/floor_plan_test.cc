#include "core/plan/floor_plan.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// The walls of rings, one each.
FloorPlan Closed(const std::vector<std::vector<Vec2>>& rings) {
  FloorPlan plan;
  plan.closed = true;
  for (const std::vector<Vec2>& ring : rings) {
    for (size_t i = 0; i < ring.size(); ++i) plan.walls.push_back({ring[i], ring[(i + 1) % ring.size()]});
  }
  return plan;
}

TEST(FloorPlan, AClosedPlanContainsWhatItsWallsEnclose) {
  // A room with a pillar, and beside it a triangle.
  const FloorPlan plan =
      Closed({{{0, 0}, {6, 0}, {6, 4}, {0, 4}}, {{2, 1}, {2, 3}, {4, 3}, {4, 1}}, {{8, 0}, {10, 4}, {7, 2}}});
  EXPECT_TRUE(plan.Contains({1, 1}));
  EXPECT_TRUE(plan.Contains({5, 3}));
  EXPECT_TRUE(plan.Contains({3, 3.5}));
  EXPECT_FALSE(plan.Contains({3, 2}));
  EXPECT_FALSE(plan.Contains({-1, 2}));
  EXPECT_FALSE(plan.Contains({7, 1}));
  EXPECT_FALSE(plan.Contains({3, 5}));
  EXPECT_TRUE(plan.Contains({8.2, 2}));
  EXPECT_FALSE(plan.Contains({9.5, 2}));
  EXPECT_FALSE(plan.Contains({9.5, 3.9}));
  // At the height of corners.
  EXPECT_TRUE(plan.Contains({1, 3}));
  EXPECT_FALSE(plan.Contains({-1, 4}));
  EXPECT_FALSE(plan.Contains({-1, 0}));
}

TEST(FloorPlan, AnOpenPlanContainsItsBox) {
  FloorPlan plan;
  plan.grid_m = 0.5;
  plan.origin = {10, 20};
  plan.low = {-2, -4};
  plan.high = {6, 2};
  for (const auto& [x, y, inside] : {std::tuple(9.0, 18.0, true),
                                     {13.0, 21.0, true},
                                     {8.9, 19.0, false},
                                     {13.1, 19.0, false},
                                     {11.0, 17.9, false},
                                     {11.0, 21.1, false}})
    EXPECT_EQ(plan.Contains({x, y}), inside) << x << ", " << y;
}

}  // namespace
}  // namespace cairn
