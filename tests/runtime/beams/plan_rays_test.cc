#include "runtime/beams/plan_rays.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

std::vector<PlanWall> RandomWalls(Random* random) {
  std::vector<PlanWall> walls;
  for (int i = 0; i < 60; ++i) {
    const double x = random->Uniform(0, 20), y = random->Uniform(0, 30);
    const double dx = random->Uniform(-6, 6), dy = random->Uniform(-6, 6);
    walls.push_back({{x, y}, {i % 5 == 0 ? x : x + dx, i % 7 == 0 ? y : y + dy}});
  }
  return walls;
}

// All walls along a ray, by looking at each.
std::vector<std::pair<double, int32_t>> AllAlong(const std::vector<PlanWall>& walls, const Vec2& origin,
                                                 const Vec2& direction, double reach) {
  std::vector<std::pair<double, int32_t>> hits;
  for (int32_t i = 0; i < std::ssize(walls); ++i) {
    const double distance = NearestAlong({walls[i]}, origin, direction);
    if (distance <= reach && std::isfinite(distance)) hits.emplace_back(distance, i);
  }
  std::sort(hits.begin(), hits.end());
  if (hits.size() > PlanRays::kMaxHits) hits.resize(PlanRays::kMaxHits);
  return hits;
}

TEST(PlanRays, FindTheFirstWallsThatARayMeets) {
  Random random(1);
  size_t num_hits = 0, num_full = 0, num_from_outside = 0;
  for (int plan = 0; plan < 10; ++plan) {
    const std::vector<PlanWall> walls = RandomWalls(&random);
    const PlanRays rays(walls);
    for (int i = 0; i < 300; ++i) {
      const double x = random.Uniform(-5, 25), y = random.Uniform(-5, 35);
      const double angle = i % 20 == 0 ? RadFromDeg(90.0 * (i / 20 % 4)) : random.Uniform(-3.2, 3.2);
      const Vec2 direction = i % 20 == 0 ? Vec2(std::round(std::cos(angle)), std::round(std::sin(angle)))
                                         : Vec2(std::cos(angle), std::sin(angle));
      const double reach = i % 3 == 0 ? 1e9 : random.Uniform(0, 12);
      const auto expected = AllAlong(walls, {x, y}, direction, reach);
      const PlanRays::Hits hits = rays.Cast({x, y}, direction, reach);
      ASSERT_EQ(hits.size, std::ssize(expected)) << "plan " << plan << ", ray " << i;
      for (int k = 0; k < hits.size; ++k) {
        EXPECT_NEAR(hits.at[k].distance_m, expected[k].first, 1e-9);
        EXPECT_EQ(hits.at[k].wall, expected[k].second);
      }
      num_hits += expected.size();
      num_full += expected.size() == PlanRays::kMaxHits ? 1 : 0;
      num_from_outside += !expected.empty() && (x < -1 || x > 21) ? 1 : 0;
    }
  }
  EXPECT_GT(num_hits, 3000u);
  EXPECT_GT(num_full, 200u);
  EXPECT_GT(num_from_outside, 50u);
}

TEST(PlanRays, MeetNothingInAPlanWithoutWallsOrAlongOne) {
  const std::vector<PlanWall> none;
  EXPECT_EQ(PlanRays(none).Cast({0, 0}, {1, 0}, 100).size, 0);
  const std::vector<PlanWall> walls = {{{1, 0}, {5, 0}}, {{3, -1}, {3, 1}}};
  const PlanRays rays(walls);
  const PlanRays::Hits along = rays.Cast({0, 0}, {1, 0}, 100);
  ASSERT_EQ(along.size, 1);
  EXPECT_EQ(along.at[0].wall, 1);
  EXPECT_EQ(rays.Cast({0, 0}, {-1, 0}, 100).size, 0);
  EXPECT_EQ(rays.Cast({0, 0}, {1, 0}, 2.9).size, 0);
  EXPECT_EQ(rays.Cast({3.5, 0}, {1, 0}, 100).size, 0);
}

TEST(PlanRays, OfWallsAtOnePlaceTheFirstOnesAreKept) {
  const std::vector<PlanWall> walls(PlanRays::kMaxHits + 2, PlanWall{{2, -1}, {2, 1}});
  const PlanRays rays(walls);
  const PlanRays::Hits hits = rays.Cast({0, 0}, {1, 0}, 10);
  ASSERT_EQ(hits.size, PlanRays::kMaxHits);
  for (int k = 0; k < hits.size; ++k) EXPECT_EQ(hits.at[k].wall, k);
}

}  // namespace
}  // namespace cairn
