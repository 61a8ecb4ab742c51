#include "runtime/paths/plan_path.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/paths/search_path.h"
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
  const Views views = decompose_views::Decomposed(kHook).views;
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
  const Views views = decompose_views::Decomposed(kHook).views;
  const PlanSpace space(views);
  EXPECT_EQ(FindPath(space, {1, 1}, {5, 2}, {})->num_links(), 1);
  EXPECT_EQ(FindMinimumLinkPath(space, {1, 1}, {5, 2}, {})->path.num_links(), 1);
}

TEST(PlanPath, TheFewestLinksAroundTheWallAreTwo) {
  const Views views = decompose_views::Decomposed(kHook).views;
  const PlanSpace space(views);
  const auto path = FindMinimumLinkPath(space, {2, 1}, {2, 5}, {.radius_m = 0.1});
  ASSERT_TRUE(path.ok());
  EXPECT_EQ(path->path.num_links(), 2);
  EXPECT_EQ(path->fewest_links, 2);
  ExpectFree(space, path->path, 0.1);
}

TEST(PlanPath, SaysWhereNoWayIs) {
  const Views views = decompose_views::Decomposed("0,0,8,0\n8,0,8,6\n8,6,0,6\n0,6,0,0\n0,3,8,3").views;
  const PlanSpace space(views);
  EXPECT_EQ(FindPath(space, {1, 1}, {1, 5}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(FindMinimumLinkPath(space, {1, 1}, {1, 5}, {}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(FindPath(space, {1, 1}, {100, 5}, {}).error().code, ErrorCode::kInvalidArgument);
  // The gap of two metres is too narrow for a robot of three.
  const Views hook = decompose_views::Decomposed(kHook).views;
  EXPECT_EQ(FindPath(PlanSpace(hook), {2, 1.5}, {2, 4.5}, {.radius_m = 1.2}).error().code,
            ErrorCode::kNoData);
}

// Lengths of the shortest path of a point and number of links of the path of few links; -1: no way.
std::pair<double, int> PointPaths(const std::string& walls, const Vec2& from, const Vec2& to) {
  const Views views = decompose_views::Decomposed(walls).views;
  const PlanSpace space(views);
  const auto path = FindPath(space, from, to, {.radius_m = 0});
  const auto few_links = FindMinimumLinkPath(space, from, to, {.radius_m = 0});
  EXPECT_EQ(path.ok(), few_links.ok());
  if (!path.ok()) {
    EXPECT_EQ(path.error().code, ErrorCode::kNoData) << path.error().message;
  }
  return {path.ok() ? path->length_m : -1, few_links.ok() ? few_links->path.num_links() : -1};
}

TEST(PlanPath, APointPassesNoJoint) {
  // (0,4) \        . to
  //         \ (2,2)
  //    from   `-. (4,0.5)      around the end on the right, not through the joint
  const auto [length, links] = PointPaths("0,4,2,2\n2,2,4,0.5", {1, 1}, {3, 3});
  EXPECT_NEAR(length, std::hypot(3, 0.5) + std::hypot(1, 2.5), 1e-6);
  EXPECT_EQ(links, 2);
}

TEST(PlanPath, WallsThatMeetHaveNoGap) {
  // A room of 4 m x 4 m, divided so that the straight way from (2, 1) to (2, 3) leads over a joint.
  const std::string room = "0,0,4,0\n4,0,4,4\n4,4,0,4\n0,4,0,0\n";
  struct Case {
    const char* what;
    const char* walls;
  };
  for (const auto& [what, walls] : {
           Case{"two ends", "0,2,2,2\n2,2,4,2"},
           Case{"a bend", "0,1.5,2,2\n2,2,4,1.5"},
           Case{"the bend seen from the other side", "0,2.5,2,2\n2,2,4,2.5"},
           Case{"an end on a wall", "0,2,4,2\n2,2,2,3.5"},
           Case{"ends on both sides of a wall", "0,2,4,2\n2,2,2,3.5\n2,2,2,0.5"},
           Case{"a crossing", "0,1,4,3\n0,3,4,1"},
           Case{"walls along each other", "0,2,2.5,2\n1.5,2,4,2"},
           Case{"a wall twice", "0,2,2,2\n2,2,0,2\n2,2,4,2\n2,2,4,2"},
           Case{"a wall of no length at the joint", "0,2,2,2\n2,2,2,2\n2,2,4,2"},
           Case{"ends that differ by rounding", "0,2,2.000003,1.999996\n1.999998,2.000004,4,2"},
           Case{"ends apart by less than --snap-m", "0,2,1.996,2\n2.003,2.002,4,2"},
           Case{"a crossing on no point of the grid", "0,1.7,4,2.3000141\n1.2,0,2.8000173,4"},
       }) {
    SCOPED_TRACE(what);
    EXPECT_EQ(PointPaths(room + walls, {2, 1}, {2, 3}), std::pair(-1.0, -1));
  }
}

TEST(PlanPath, APointWalksAlongWallsAndAroundTheirEnds) {
  //   from ==========+=========== to      in line with a wall from (1, 2) to (3, 2)
  const Vec2 from(0.5, 2), to(3.5, 2);
  const auto expect = [&](const std::string& walls, double length, int links) {
    SCOPED_TRACE(walls);
    const auto [found_length, found_links] = PointPaths(walls + "\n0,5,4,5", from, to);
    EXPECT_NEAR(found_length, length, 1e-6);
    EXPECT_EQ(found_links, links);
  };
  expect("1,2,3,2", 3, 1);
  // A wall away from it on one side leaves the other.
  expect("1,2,3,2\n2,2,2,3", 3, 1);
  expect("1,2,3,2\n2,2,2,1", 3, 1);
  // On both sides: over the end of one of them.
  expect("1,2,3,2\n2,3,2,1", 2 * std::hypot(1.5, 1), 2);
  // First on one side, then on the other: no way along it, for one cannot change sides in between ...
  expect("1,2,3,2\n1.5,2,1.5,3\n2.5,2,2.5,1", std::hypot(1, 1) + std::hypot(2, 1), 2);
  // ... but where there is a gap.
  expect("1,2,1.9,2\n2.1,2,3,2\n1.5,2,1.5,3\n2.5,2,2.5,1", 3, 1);
  // Past ends that touch the way from either side, and not between two that meet on it.
  expect("2,2,2,3", 3, 1);
  expect("1.5,2,1.5,3\n2.5,2,2.5,1", 3, 1);
  expect("2,2,2,3\n2,2,2,1", 2 * std::hypot(1.5, 1), 2);
}

TEST(PlanPath, APlaceOnAWallOrNearerThanTheRadiusIsNamed) {
  const Views views = decompose_views::Decomposed(kHook).views;
  const PlanSpace space(views);
  for (const Vec2& place : {Vec2(3, 3), Vec2(6, 3)}) {
    const auto path = FindPath(space, place, {1, 1}, {.radius_m = 0});
    ASSERT_FALSE(path.ok());
    EXPECT_EQ(path.error().code, ErrorCode::kNoData);
    EXPECT_THAT(path.error().message, testing::HasSubstr("lies on a wall"));
  }
  for (const double radius : {0.3, 3.0}) {
    const PlanPathOptions options{.radius_m = radius};
    const Vec2 near(2, 3.25), away(2, 1);
    for (const Error& error :
         {FindPath(space, near, away, options).error(),
          FindMinimumLinkPath(space, near, away, options).error(),
          FindSearchPath(space, near, options).error(), FindPath(space, near, near, options).error()}) {
      EXPECT_EQ(error.code, ErrorCode::kNoData);
      EXPECT_THAT(error.message, testing::HasSubstr("does not fit at (2, 3.25): a wall is 0.250 m away"));
    }
  }
  EXPECT_TRUE(FindPath(space, {2, 3.25}, {2, 4}, {.radius_m = 0.25}).ok());
  EXPECT_EQ(FindPath(space, {1, 1}, {std::nan(""), 1}, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(FindPath(space, {1, 1}, {1, std::nan("")}, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(FindPath(space, {1, -INFINITY}, {1, 1}, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(FindPath(space, {1, 1}, {1e300, 1}, {}).error().code, ErrorCode::kInvalidArgument);
}

TEST(PlanPath, FromAPlaceToItselfIsNoLink) {
  const Views views = decompose_views::Decomposed(kHook).views;
  const PlanSpace space(views);
  for (const double radius : {0.0, 0.3}) {
    const auto short_path = FindPath(space, {1, 1}, {1, 1}, {.radius_m = radius});
    const auto few_links = FindMinimumLinkPath(space, {1, 1}, {1, 1}, {.radius_m = radius});
    ASSERT_TRUE(short_path.ok());
    ASSERT_TRUE(few_links.ok());
    EXPECT_TRUE(few_links->is_optimal());
    for (const PlanPath& path : {*short_path, few_links->path}) {
      EXPECT_EQ(path.points, std::vector<Vec2>{Vec2(1, 1)});
      EXPECT_EQ(path.length_m, 0);
      EXPECT_EQ(path.num_links(), 0);
    }
  }
}

TEST(PlanPath, ADiscTurnsOnACircleAroundTheWallsEnd) {
  // From (2, 1) to (2, 5) around (6, 3) at 0.8 m: two tangents, and the arc between their ends.
  constexpr double kRadius = 0.8;
  const Views views = decompose_views::Decomposed(kHook).views;
  const PlanSpace space(views);
  const auto path = FindPath(space, {2, 1}, {2, 5}, {.radius_m = kRadius});
  ASSERT_TRUE(path.ok()) << path.error().message;
  const double distance = std::hypot(4, 2);
  const double arc = kRadius * 2 * (std::numbers::pi - std::atan2(2, 4) - std::acos(kRadius / distance));
  const double shortest = 2 * std::sqrt(distance * distance - kRadius * kRadius) + arc;
  EXPECT_GT(path->length_m, shortest);
  EXPECT_LT(path->length_m, shortest + 0.02 * arc);
  ExpectFree(space, *path, kRadius);
  // The passage is 2 m wide.
  EXPECT_TRUE(FindPath(space, {2, 1.5}, {2, 4.5}, {.radius_m = 0.99}).ok());
  EXPECT_FALSE(FindPath(space, {2, 1.5}, {2, 4.5}, {.radius_m = 1.001}).ok());
}

TEST(PlanPath, NothingLeavesAClosedPlan) {
  // A U of a corridor 1 m wide: the straight way over the notch, (1, 1) to (3, 1), is outside.
  const Views views =
      decompose_views::Decomposed(
          decompose_views::PolygonText({{{0, 0}, {4, 0}, {4, 3}, {3, 3}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}}))
          .views;
  const PlanSpace space(views);
  const auto path = FindPath(space, {0.5, 2.5}, {3.5, 2.5}, {.radius_m = 0});
  ASSERT_TRUE(path.ok());
  EXPECT_NEAR(path->length_m, 2 + 2 * std::hypot(0.5, 1.5), 1e-6);
  EXPECT_EQ(path->points.size(), 4u);
  EXPECT_EQ(FindPath(space, {0.5, 2.5}, {2, 2}, {.radius_m = 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(space.IsFree({-1, 1}, {-2, 1}, 0.1));
  EXPECT_FALSE(space.PassageBetween({-1, 1}, {-2, 1}).IsOpen());
}

TEST(FaceLocator, APointOnABorderIsInARegion) {
  // Whole and half points lie on many borders of this plan.
  const Views views =
      decompose_views::Decomposed("0,0,7,0\n7,0,7,7\n7,7,0,7\n0,7,0,0\n2,2,5,3\n4,5,1,4\n3,3,3,4").views;
  const FaceLocator locator(views);
  const double area = [&] {
    double sum = 0;
    for (FaceIdx face = 0; face < views.num_faces(); ++face) sum += views.Area(face);
    return sum;
  }();
  EXPECT_GT(area, 49);
  for (double x = 0.25; x < 7; x += 0.25) {
    for (double y = 0.25; y < 7; y += 0.25) EXPECT_GE(locator.Find({x, y}), 0) << x << " " << y;
  }
  // And on the borders themselves, to the last digit.
  for (const ViewLink& link : views.links) {
    const Vec2 start = views.plan.Metres(views.vertices[link.start]),
               end = views.plan.Metres(views.vertices[link.end]);
    for (const double share : {0.25, 0.5, 1.0 / 3, 0.7}) {
      EXPECT_GE(locator.Find(start + share * (end - start)), 0);
    }
  }
}

// Regions of a file may lie over each other, all of them over the whole plan.
TEST(FaceLocator, RegionsOverEachOtherTakeNoMoreRoomThanThereIs) {
  Views views = decompose_views::Decomposed("0,0,7,0\n7,0,7,7\n7,7,0,7\n0,7,0,0").views;
  ASSERT_GE(views.num_faces(), 1);
  const std::vector<int32_t> corners(views.face_vertices.begin(),
                                     views.face_vertices.begin() + views.face_offsets[1]);
  constexpr FaceIdx kNumFaces = 3000;
  views.face_vertices.clear();
  views.face_offsets = {0};
  views.parents.assign(kNumFaces, -1);
  for (FaceIdx face = 0; face < kNumFaces; ++face) {
    views.face_vertices.insert(views.face_vertices.end(), corners.begin(), corners.end());
    views.face_offsets.push_back(std::ssize(views.face_vertices));
  }
  const FaceLocator locator(views);
  EXPECT_GE(locator.num_entries(), kNumFaces);
  EXPECT_LE(locator.num_entries(), 32 * kNumFaces);
  EXPECT_EQ(locator.Find({3, 4}), 0);
  EXPECT_EQ(locator.Find({8, 4}), -1);
}

}  // namespace
}  // namespace cairn
