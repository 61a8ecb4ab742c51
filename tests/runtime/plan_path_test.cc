#include "runtime/plan_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/disambiguate.h"
#include "tests/decompose_views/plan_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

void ExpectFree(const PlanSpace& space, const PlanPath& path, double radius_m) {
  double length = 0;
  for (size_t i = 0; i + 1 < path.points.size(); ++i) {
    EXPECT_TRUE(space.IsFree(path.points[i], path.points[i + 1], radius_m)) << i;
    length += (path.points[i + 1] - path.points[i]).norm();
  }
  EXPECT_NEAR(path.length_m, length, 1e-9);
}

// A room with a wall across that leaves two metres on the right: from below to above one has to turn once.
const char* const kHook = "0,0,8,0\n8,0,8,6\n8,6,0,6\n0,6,0,0\n0,3,6,3";

TEST(PlanPath, GoesAroundAWall) {
  const Views views = Decomposed(kHook).views;
  const PlanSpace space(views);
  const auto path = FindPath(space, {1, 1}, {1, 5}, {.radius_m = 0.3});
  ASSERT_TRUE(path.ok()) << path.error().message;
  EXPECT_EQ(path->points.front(), Vec2(1, 1));
  EXPECT_EQ(path->points.back(), Vec2(1, 5));
  ExpectFree(space, *path, 0.3);
  // Not shorter than around the wall's end, not much longer.
  EXPECT_GT(path->length_m, 2 * std::hypot(5, 2));
  EXPECT_LT(path->length_m, 1.2 * 2 * std::hypot(5, 2));
}

TEST(PlanPath, WhatIsSeenIsReachedStraight) {
  const Views views = Decomposed(kHook).views;
  const PlanSpace space(views);
  EXPECT_EQ(FindPath(space, {1, 1}, {5, 2}, {})->num_links(), 1);
  EXPECT_EQ(FindMinimumLinkPath(space, {1, 1}, {5, 2}, {})->num_links(), 1);
}

TEST(PlanPath, TheFewestLinksAroundTheWallAreTwo) {
  const Views views = Decomposed(kHook).views;
  const PlanSpace space(views);
  const auto path = FindMinimumLinkPath(space, {2, 1}, {2, 5}, {.radius_m = 0.1});
  ASSERT_TRUE(path.ok());
  EXPECT_EQ(path->num_links(), 2);
  ExpectFree(space, *path, 0.1);
}

TEST(PlanPath, SaysWhereNoWayIs) {
  const Views views = Decomposed("0,0,8,0\n8,0,8,6\n8,6,0,6\n0,6,0,0\n0,3,8,3").views;
  const PlanSpace space(views);
  EXPECT_EQ(FindPath(space, {1, 1}, {1, 5}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(FindMinimumLinkPath(space, {1, 1}, {1, 5}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(FindPath(space, {1, 1}, {100, 5}, {}).error().code, ErrorCode::kInvalidArgument);
  // The gap of two metres is too narrow for a robot of three.
  const Views hook = Decomposed(kHook).views;
  EXPECT_EQ(FindPath(PlanSpace(hook), {2, 1.5}, {2, 4.5}, {.radius_m = 1.2}).error().code,
            ErrorCode::kNoData);
}

TEST(PlanPath, ASearchPathSeesEveryRoom) {
  const Views views =
      Decomposed(PolygonText({{{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 4}, {6, 4}, {6, 6}, {0, 6}}})).views;
  const PlanSpace space(views);
  const auto search = FindSearchPath(space, {5, 1}, {.radius_m = 0.1});
  ASSERT_TRUE(search.ok());
  EXPECT_NEAR(search->seen_area_m2, search->reachable_area_m2, 1e-6);
  EXPECT_NEAR(search->reachable_area_m2, 36 - 8, 0.01 * 36);
  ExpectFree(space, search->path, 0.1);
  // Every random point of the upper arm is seen from one of the places.
  for (double x = 2.3; x < 6; x += 0.7) {
    for (double y = 4.2; y < 6; y += 0.4) {
      EXPECT_TRUE(std::any_of(search->places.begin(), search->places.end(), [&](const Vec2& place) {
        return space.IsFree(place, {x, y}, 0);
      }));
    }
  }
}

TEST(Disambiguate, ViewsThatDifferAreToldApartAtOnce) {
  // The right room has a pillar.
  const Views views = Decomposed("0,0,8,0\n8,0,8,3\n8,3,0,3\n0,3,0,0\n4,0,4,3\n7,1.5,7,2").views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{1, 1.5}, 0}, {{5, 1.5}, 0}, {});
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->kind, 1);
  EXPECT_FALSE(plan->path_a.empty());
}

TEST(Disambiguate, RoomsThatLookTheSameNeedALookAroundTheCorner) {
  //  +-----+-----+    Two elbows; only the right one's arm has a pillar, which is hidden
  //  |  +--+  +--+    from the lower ends.
  //  |  |  |  |
  const std::string left = "0,0,0,5\n0,5,4,5\n4,5,4,4\n4,4,1,4\n1,4,1,0\n1,0,0,0\n";
  const std::string right =
      "10,0,10,5\n10,5,14,5\n14,5,14,4\n14,4,11,4\n11,4,11,0\n11,0,10,0\n13,4.3,13,4.7\n";
  const Views views = Decomposed(left + right).views;
  const PlanSpace space(views);
  const auto plan = PlanDisambiguation(space, {{0.5, 0.5}, 1.57}, {{10.5, 0.5}, 1.57}, {.radius_m = 0.1});
  ASSERT_TRUE(plan.ok());
  EXPECT_GE(plan->kind, 2);
  ASSERT_GE(plan->path_a.size(), 2u);
  // The same motion in both, free, and up to where one looks into the arm.
  for (size_t i = 0; i < plan->path_a.size(); ++i)
    EXPECT_NEAR((plan->path_b[i] - plan->path_a[i] - Vec2(10, 0)).norm(), 0, 1e-9);
  for (size_t i = 0; i + 1 < plan->path_a.size(); ++i) {
    EXPECT_TRUE(space.IsFree(plan->path_a[i], plan->path_a[i + 1], 0.1));
    EXPECT_TRUE(space.IsFree(plan->path_b[i], plan->path_b[i + 1], 0.1));
  }
  EXPECT_GT(plan->path_a.back().y(), 2);
  EXPECT_FALSE(plan->feature_is_at_a);
}

TEST(Disambiguate, PlacesThatNothingTellsApartAreSaidToBeSo) {
  const Views views =
      Decomposed("0,0,3,0\n3,0,3,3\n3,3,0,3\n0,3,0,0\n10,0,13,0\n13,0,13,3\n13,3,10,3\n10,3,10,0").views;
  const PlanSpace space(views);
  EXPECT_EQ(PlanDisambiguation(space, {{1, 1}, 0}, {{11, 1}, 0}, {})->kind, 0);
  EXPECT_EQ(PlanDisambiguation(space, {{1, 1}, 0}, {{1000, 1}, 0}, {}).error().code,
            ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace cairn
