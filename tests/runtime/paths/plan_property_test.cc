// Paths against brute force, on small plans with all that makes trouble: joints, crossings, ends on walls,
// walls along each other.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/paths/plan_path.h"
#include "runtime/paths/search_path.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

Vec2 RandomPlace(Random& random, int size) {
  return {random.Uniform(-0.8, size + 0.8), random.Uniform(-0.8, size + 0.8)};
}

// Either both kinds find a way or neither does; what they find starts and ends where it should.
void ExpectSameWay(const Result<PlanPath>& path, const Result<MinimumLinkPath>& found, const Vec2& from,
                   const Vec2& to) {
  ASSERT_EQ(path.ok(), found.ok());
  if (!path.ok()) {
    EXPECT_EQ(path.error().code, found.error().code);
    return;
  }
  const PlanPath& few_links = found->path;
  EXPECT_EQ(path->points.front(), from);
  EXPECT_EQ(path->points.back(), to);
  EXPECT_EQ(few_links.points.front(), from);
  EXPECT_EQ(few_links.points.back(), to);
  EXPECT_LE(few_links.num_links(), path->num_links());
  EXPECT_LE(found->fewest_links, few_links.num_links());
  EXPECT_GE(path->length_m, (to - from).norm() - 1e-9);
  EXPECT_LE(path->length_m, few_links.length_m + 1e-6);
}

TEST(PlanProperty, APointGoesTheShortestWayThatBruteForceFinds) {
  constexpr int kSize = 6;
  constexpr uint64_t kNumSeeds = 250;
  int num_ways = 0, num_turns = 0, num_without = 0;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    Random random(MixSeed(17, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(3, 14)), kSize));
    const Views views = Decomposed(oracle.Text(), decompose_views::FineGrid()).views;
    const PlanSpace space(views);
    for (int i = 0; i < 4; ++i) {
      const Vec2 from = RandomPlace(random, kSize), to = RandomPlace(random, kSize);
      if (space.FaceAt(from) < 0 || space.FaceAt(to) < 0) continue;
      const std::string what =
          fmt::format("seed {}: {},{} to {},{}\n{}", seed, from.x(), from.y(), to.x(), to.y(), oracle.Text());
      SCOPED_TRACE(what);
      const auto path = FindPath(space, from, to, {.radius_m = 0});
      const auto few_links = FindMinimumLinkPath(space, from, to, {.radius_m = 0});
      ExpectSameWay(path, few_links, from, to);
      const std::optional<double> shortest = oracle.ShortestLength(from, to);
      ASSERT_EQ(path.ok(), shortest.has_value());
      num_without += !shortest;
      if (!shortest) continue;
      EXPECT_NEAR(path->length_m, *shortest, 1e-3);
      EXPECT_TRUE(oracle.CanBeWalked(path->points));
      EXPECT_TRUE(oracle.CanBeWalked(few_links->path.points));
      ++num_ways;
      num_turns += path->num_links() - 1;
    }
  }
  EXPECT_GT(num_ways, 600);
  EXPECT_GT(num_turns, num_ways);
  EXPECT_GT(num_without, 50);
}

TEST(PlanProperty, ADiscGoesTheShortestWayUpToItsPolygon) {
  constexpr int kSize = 6;
  constexpr uint64_t kNumSeeds = 250;
  int num_ways = 0, num_without = 0;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    Random random(MixSeed(18, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(3, 14)), kSize));
    const Views views = Decomposed(oracle.Text(), decompose_views::FineGrid()).views;
    const PlanSpace space(views);
    const double radius = random.Uniform(0.05, 0.5);
    const Vec2 from = RandomPlace(random, kSize), to = RandomPlace(random, kSize);
    if (space.FaceAt(from) < 0 || space.FaceAt(to) < 0) continue;
    const std::string what = fmt::format("seed {}: {},{} to {},{} radius {}\n{}", seed, from.x(), from.y(),
                                         to.x(), to.y(), radius, oracle.Text());
    SCOPED_TRACE(what);
    const auto path = FindPath(space, from, to, {.radius_m = radius});
    const auto few_links = FindMinimumLinkPath(space, from, to, {.radius_m = radius});
    ExpectSameWay(path, few_links, from, to);
    const bool fits = oracle.Clearance(from, from) >= radius && oracle.Clearance(to, to) >= radius;
    if (!fits) {
      ASSERT_FALSE(path.ok());
      EXPECT_THAT(path.error().message, testing::HasSubstr("does not fit"));
      continue;
    }
    if (path.ok()) {
      for (size_t i = 0; i + 1 < path->points.size(); ++i)
        EXPECT_GE(oracle.Clearance(path->points[i], path->points[i + 1]), radius - 1e-6);
      const std::vector<Vec2>& turns = few_links->path.points;
      for (size_t i = 0; i + 1 < turns.size(); ++i)
        EXPECT_GE(oracle.Clearance(turns[i], turns[i + 1]), radius - 1e-6);
      const std::optional<double> shortest = oracle.ShortestLength(from, to, radius * 0.998);
      ASSERT_TRUE(shortest.has_value());
      EXPECT_GT(path->length_m, *shortest - 0.01);
      ++num_ways;
    } else {
      ++num_without;
    }
    if (const auto wider = oracle.ShortestLength(from, to, 1.0196 * radius)) {  // 1 / cos(pi / 16)
      ASSERT_TRUE(path.ok()) << path.error().message;
      EXPECT_LE(path->length_m, *wider + 1e-3);
    }
  }
  EXPECT_GT(num_ways, 90);
  EXPECT_GT(num_without, 2);
}

TEST(PlanProperty, ASearchReachesWhatAShortPathReaches) {
  constexpr int kSize = 5;
  int num_partly = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    Random random(MixSeed(19, seed));
    const PlanOracle oracle(RandomWalls(random, 7, kSize));
    const Views views = Decomposed(oracle.Text(), decompose_views::FineGrid()).views;
    const PlanSpace space(views);
    const Vec2 from = RandomPlace(random, kSize);
    if (space.FaceAt(from) < 0) continue;
    SCOPED_TRACE(fmt::format("seed {}: {},{}\n{}", seed, from.x(), from.y(), oracle.Text()));
    PlanPathOptions options{.radius_m = 0};
    const auto search = FindSearchPath(space, from, options);
    ASSERT_TRUE(search.ok()) << search.error().message;
    EXPECT_TRUE(oracle.CanBeWalked(search->path.points));
    double area = 0, reached = 0;
    for (FaceIdx face = 0; face < views.num_faces(); ++face) {
      area += views.Area(face);
      if (FindPath(space, from, views.Centroid(face), options).ok()) reached += views.Area(face);
    }
    // A point sees all that it gets to.
    EXPECT_NEAR(search->domain_area_m2, area, 1e-6 * area);
    EXPECT_NEAR(search->visible_area_m2, reached, 1e-6 * area);
    EXPECT_NEAR(search->unreached_area_m2, area - reached, 1e-6 * area);
    EXPECT_NEAR(search->seen_area_m2, reached, 1e-3 * area);
    num_partly += reached < 0.999 * area;
  }
  EXPECT_GE(num_partly, 10);
}

}  // namespace
}  // namespace cairn
