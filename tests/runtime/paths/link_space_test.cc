#include "runtime/paths/link_space.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
using Bound = LinkSpace::Bound;
constexpr double kPi = std::numbers::pi;
constexpr double kUp = 0.5 * kPi, kDown = -0.5 * kPi;

double Along(const std::vector<BlockedArc>& view, double angle) {
  const auto arc = FirstArcFrom(view, angle);
  return arc == view.end() || arc->from > angle ? 0 : arc->Distance(angle);
}

TEST(LinkDirections, AreThoseThatGoOnBehindTheCorner) {
  //      | free    Free from +x over three quarters: a link to the left, or from there, passes the corner
  //   ---+         where it comes from [0, 90] degrees and goes to [180, 270], or the other way round.
  //  ####|
  const std::vector<DirectionRange> ranges = LinkDirections({{0, 0}, 0, 1.5 * kPi});
  ASSERT_EQ(ranges.size(), 2u);
  for (const DirectionRange& range : ranges) EXPECT_NEAR(range.width, 0.5 * kPi + 4e-9, 1e-14);
  EXPECT_NEAR(ranges[0].from, -2e-9, 1e-14);
  EXPECT_NEAR(ranges[1].from, kPi - 2e-9, 1e-14);
  // Directions in [-pi, pi].
  const std::vector<DirectionRange> wrapped = LinkDirections({{0, 0}, 0.75 * kPi, 1.5 * kPi});
  EXPECT_NEAR(wrapped[0].from, 0.75 * kPi, 1e-8);
  EXPECT_NEAR(wrapped[1].from, -0.25 * kPi, 1e-8);
  EXPECT_NEAR(LinkDirections({{0, 0}, -kPi, 1.5 * kPi})[0].from, kPi - 2e-9, 1e-14);
}

// A wall from (1, 1) to (3, 1) in a box of 4 m x 2 m, looked at from (2, 0.25).
class OneWall : public testing::Test {
 protected:
  const Views views_ = decompose_views::Decomposed("1,1,3,1").views;
  const PlanSpace space_{views_};
  const double grid_m_ = views_.plan.grid_m;
  const Vec2 below_{2, 0.25}, far_{0.2, 0.2};
  // How far a link gets up to the wall, and down to the border of the box, in units of the grid.
  std::pair<double, double> UpAndDown(double radius_m, Bound bound, const Vec2& to) const {
    const LinkSpace links(space_, radius_m, bound, below_, to);
    const std::vector<BlockedArc> view = links.ViewFrom(links.from());
    return {Along(view, kUp), Along(view, kDown)};
  }
};

TEST_F(OneWall, IsGrownByTheRadiusUpToAMargin) {
  const auto expect = [&](double radius_m, Bound bound, double grown, double beyond_box) {
    const auto [up, down] = UpAndDown(radius_m, bound, far_);
    EXPECT_NEAR(up, 0.75 / grid_m_ - grown, 1e-6);
    EXPECT_NEAR(down, 0.25 / grid_m_ + beyond_box, 1e-6);
  };
  // A disc: a micrometre less, or more.
  expect(0.25, Bound::kOuter, (0.25 - 1e-6) / grid_m_, 1);
  expect(0.25, Bound::kInner, (0.25 + 1e-6) / grid_m_, 0);
  // One that is hardly larger than that: half of its radius.
  expect(1e-6, Bound::kOuter, 0.5e-6 / grid_m_, 1);
  expect(1e-6, Bound::kInner, 1.5e-6 / grid_m_, 0);
  // A point: the wall itself, or four units of the grid.
  expect(0, Bound::kOuter, 0, 1);
  expect(0, Bound::kInner, 4, 0);
}

TEST_F(OneWall, IsNotGrownOverThePlacesWhereTheRobotStands) {
  // The polygon around a circle of 0.25 m reaches up to 0.2512 m.
  const double wall = 0.75 / grid_m_, grown = (0.25 + 1e-6) / grid_m_;
  EXPECT_NEAR(UpAndDown(0.25, Bound::kInner, {2.5, 1 - 0.251}).first, wall, 1e-6);
  EXPECT_NEAR(UpAndDown(0.25, Bound::kInner, {2.5, 1.251}).first, wall, 1e-6);
  EXPECT_NEAR(UpAndDown(0.25, Bound::kInner, {2.5, 1 - 0.2513}).first, wall - grown, 1e-6);
  EXPECT_NEAR(UpAndDown(0.25, Bound::kOuter, {2.5, 1 - 0.251}).first, wall - (0.25 - 1e-6) / grid_m_, 1e-6);
  // Near to one end, or to both: no polygon is made around it.
  const auto num_corners = [&](const Vec2& from, const Vec2& to) {
    return LinkSpace(space_, 0.25, Bound::kInner, from, to).corners().size();
  };
  EXPECT_EQ(num_corners(below_, far_), 32u);
  EXPECT_EQ(num_corners(below_, {3.251, 1}), 16u);
  EXPECT_EQ(num_corners({0.749, 1}, far_), 16u);
  EXPECT_EQ(num_corners({0.749, 1}, {3.251, 1}), 0u);
}

TEST_F(OneWall, HasPolygonsAroundItsEnds) {
  // Half a circle in 16 parts: in it with corners at both ends, and around it with one on each part.
  const double step = kPi / 16;
  for (const Bound bound : {Bound::kOuter, Bound::kInner}) {
    const LinkSpace links(space_, 0.25, bound, below_, far_);
    const bool outer = bound == Bound::kOuter;
    ASSERT_EQ(links.corners().size(), outer ? 34u : 32u);
    const double radius = outer ? (0.25 - 1e-6) / grid_m_ : (0.25 + 1e-6) / grid_m_ / std::cos(0.5 * step);
    std::vector<double> angles;
    for (const LinkSpace::Corner& corner : links.corners()) {
      const Vec2 left = corner.place - views_.plan.Grid(Vec2(1, 1)),
                 right = corner.place - views_.plan.Grid(Vec2(3, 1));
      const bool is_left = left.norm() < right.norm();
      EXPECT_NEAR((is_left ? left : right).norm(), radius, 1e-4);
      const double angle = is_left ? AngleOf(-left) : AngleOf(right);
      const bool is_rim = outer && std::abs(angle) > 0.5 * kPi - 0.1 * step;
      EXPECT_NEAR(corner.free_angle, kPi + (is_rim ? 0.5 : 1) * step, 1e-5);
      EXPECT_GE(corner.from, -kPi);
      EXPECT_LE(corner.from, kPi);
      // A quarter clockwise of the way out, or less by half of what is more than half a turn.
      const double out = is_left ? angle + kPi : angle;
      const double middle = corner.from + 0.5 * corner.free_angle;
      if (!is_rim) EXPECT_NEAR(std::remainder(middle - out, 2 * kPi), 0, 1e-5);
      angles.push_back(angle);
    }
    std::sort(angles.begin(), angles.end());
    for (size_t i = 0; i < angles.size(); ++i)
      EXPECT_NEAR(angles[i], (outer ? -8 : -7.5) * step + static_cast<double>(i / 2) * step, 1e-5);
  }
}

TEST_F(OneWall, LetsNoLinkRunAlongItself) {
  const LinkSpace links(space_, 0, Bound::kOuter, below_, far_);
  ASSERT_EQ(links.corners().size(), 2u);
  for (const LinkSpace::Corner& corner : links.corners()) {
    const bool is_left = corner.place.x() < links.from().x();
    EXPECT_NEAR(std::remainder(corner.from - (is_left ? 0 : kPi), 2 * kPi), 0, 1e-12);
    EXPECT_NEAR(corner.free_angle, 2 * kPi, 1e-12);
    const std::vector<BlockedArc> view = links.ViewFrom(corner);
    EXPECT_EQ(links.Reach(corner, view, is_left ? 0 : kPi), 0);
    EXPECT_NEAR(links.Reach(corner, view, is_left ? kPi : 0), 1 / grid_m_ + 1, 1e-6);
    EXPECT_NEAR(links.Reach(corner, view, kUp), 1 / grid_m_ + 1, 1e-6);
    EXPECT_NEAR(links.Reach(corner, view, kDown), 1 / grid_m_ + 1, 1e-6);
  }
}

TEST(LinkSpace, ALinkFromACornerEndsWhereAWallInLineBegins) {
  //  (1,1) ---- (2,1)     (3,1) ---- (5,1)      and one across at x = 7
  const Views views = decompose_views::Decomposed("1,1,2,1\n3,1,5,1\n7,0,7,2").views;
  const PlanSpace space(views);
  const LinkSpace links(space, 0, Bound::kOuter, {1.5, 0.2}, {6, 1.7});
  int num_found = 0;
  for (const LinkSpace::Corner& corner : links.corners()) {
    const Vec2 place = views.plan.Metres(corner.place.x(), corner.place.y());
    const std::vector<BlockedArc> view = links.ViewFrom(corner);
    const double ahead = links.Reach(corner, view, 0) * views.plan.grid_m,
                 back = links.Reach(corner, view, kPi) * views.plan.grid_m;
    num_found += 1;
    if ((place - Vec2(2, 1)).norm() < 1e-6) {
      EXPECT_NEAR(ahead, 1, 1e-4);
    } else if ((place - Vec2(3, 1)).norm() < 1e-6) {
      EXPECT_NEAR(back, 1, 1e-4);
    } else if ((place - Vec2(5, 1)).norm() < 1e-6) {
      EXPECT_NEAR(ahead, 2, 1e-4);
    } else if ((place - Vec2(1, 1)).norm() < 1e-6) {
      EXPECT_NEAR(back, 1, 1e-4);
    } else {
      --num_found;
    }
  }
  EXPECT_EQ(num_found, 4);
}

TEST(LinkSpace, FromACornerALinkSeesWhatAPlaceThereSees) {
  int num_compared = 0;
  for (uint64_t seed = 0; seed < 12; ++seed) {
    Random random(MixSeed(29, seed));
    const PlanOracle oracle(RandomWalls(random, 7, 6));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    for (const double radius : {0.0, 0.2}) {
      for (const Bound bound : {Bound::kOuter, Bound::kInner}) {
        const LinkSpace links(space, radius, bound, {-0.9, -0.9}, {6.9, 6.9});
        for (size_t i = 0; i < links.corners().size(); i += 3) {
          const LinkSpace::Corner& corner = links.corners()[i];
          const std::vector<BlockedArc> view = links.ViewFrom(corner), all = links.ViewFrom(corner.place);
          EXPECT_LE(view.size(), all.size() + 2);
          for (const DirectionRange& range : LinkDirections(corner)) {
            for (int k = 0; k < 12; ++k) {
              const double angle =
                  std::remainder(range.from + random.Uniform(0.01, 0.99) * range.width, 2 * kPi);
              const double distance = Along(all, angle);
              EXPECT_NEAR(Along(view, angle), distance, 1e-6 * distance) << seed << " " << angle;
              ++num_compared;
            }
          }
        }
      }
    }
  }
  EXPECT_GT(num_compared, 5000);
}

TEST(LinkSpace, CornersAreWhereTheRobotFits) {
  // Two walls 0.4 m from each other: discs of 0.25 m do not fit between them.
  const Views views = decompose_views::Decomposed("1,1,3,1\n1,1.4,3,1.4").views;
  const PlanSpace space(views);
  for (const Bound bound : {Bound::kOuter, Bound::kInner}) {
    const LinkSpace links(space, 0.25, bound, {0.2, 0.2}, {3.8, 0.2});
    const double least = bound == Bound::kOuter ? 0.25 * std::cos(kPi / 32) - 1.1e-6 : 0.25;
    int num_all = 0;
    for (const Vec2& end : {Vec2(1, 1), Vec2(3, 1), Vec2(1, 1.4), Vec2(3, 1.4)}) {
      for (int k = 0; k < 17; ++k) {
        if (bound == Bound::kInner && k == 16) continue;
        const double angle =
            (end.x() < 2 ? kUp : kDown) + (k + (bound == Bound::kOuter ? 0 : 0.5)) * kPi / 16;
        const double radius = bound == Bound::kOuter ? 0.25 - 1e-6 : (0.25 + 1e-6) / std::cos(kPi / 32);
        num_all += space.Clearance(end + radius * Vec2(std::cos(angle), std::sin(angle))) >= least;
      }
    }
    EXPECT_EQ(links.corners().size(), static_cast<size_t>(num_all));
    EXPECT_LT(num_all, 60);
    for (const LinkSpace::Corner& corner : links.corners())
      EXPECT_GE(space.Clearance(views.plan.Metres(corner.place.x(), corner.place.y())), least);
  }
}

}  // namespace
}  // namespace cairn
