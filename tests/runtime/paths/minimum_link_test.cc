// Paths of the fewest links: cases by hand, and beside brute force over dense turning points.

#include <gtest/gtest.h>

#include "runtime/paths/plan_path.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

MinimumLinkPath FewestLinks(const std::string& text, const Vec2& from, const Vec2& to, double radius_m) {
  const Views views = decompose_views::Decomposed(text).views;
  const PlanSpace space(views);
  const auto found = FindMinimumLinkPath(space, from, to, {.radius_m = radius_m});
  EXPECT_TRUE(found.ok()) << found.error().message;
  if (!found.ok()) return {};
  for (size_t i = 0; i + 1 < found->path.points.size(); ++i) {
    EXPECT_TRUE(radius_m > 0
                    ? space.IsFree(found->path.points[i], found->path.points[i + 1], radius_m)
                    : space.PassageBetween(found->path.points[i], found->path.points[i + 1]).IsOpen());
  }
  return *found;
}

void ExpectLinks(int num_links, const std::string& text, const Vec2& from, const Vec2& to, double radius_m) {
  SCOPED_TRACE(fmt::format("radius {} of {}", radius_m, text));
  const MinimumLinkPath found = FewestLinks(text, from, to, radius_m);
  EXPECT_EQ(found.path.num_links(), num_links);
  EXPECT_EQ(found.fewest_links, num_links);
  EXPECT_TRUE(found.is_optimal());
}

// Two rooms of 4 m x 4 m side by side, with a door in the wall x = 4 between y = `low` and `high`.
std::string TwoRooms(double low, double high) {
  return fmt::format("0,0,8,0\n8,0,8,4\n8,4,0,4\n0,4,0,0\n4,0,4,{}\n4,{},4,4", low, high);
}

TEST(MinimumLinkPath, TurnsAnywhereBehindANarrowDoor) {
  // A door of 0.5 m leaves a disc of 0.2 m a slit of 0.1 m, and less at an angle.
  ExpectLinks(2, TwoRooms(3, 3.5), {0.3, 1.5}, {7, 0.5}, 0.2);
  ExpectLinks(2, TwoRooms(3, 3.5), {0.3, 1.5}, {7, 0.5}, 0);
  ExpectLinks(2, TwoRooms(3, 3.45), {0.3, 1.5}, {7, 0.5}, 0.2);
  // At more than 36.9 degrees it does not fit through, but it can turn in the door, 0.28 m from its lower
  // end.
  ExpectLinks(2, TwoRooms(3, 3.5), {1, 0.5}, {7, 0.5}, 0.2);
  ExpectLinks(2, TwoRooms(3, 3.5), {1, 0.5}, {7, 0.5}, 0);
  ExpectLinks(3, TwoRooms(3, 3.5), {3.7, 0.5}, {4.3, 0.5}, 0.2);
}

TEST(MinimumLinkPath, CountsTheArmsOfASpiral) {
  // Corridors 1 m wide between walls that leave a gap at alternating ends: the middle of each gap is not in
  // line with the next.
  //   +--------------------+
  //   |  ----------------- |
  //   | -----------------  |
  //   |  ----------------- |
  //   +--------------------+
  std::string walls = "0,0,10,0\n10,0,10,5\n10,5,0,5\n0,5,0,0\n";
  walls += "1,1,10,1\n0,2,9,2\n1,3,10,3\n0,4,9,4\n";
  ExpectLinks(1, walls, {9.5, 0.5}, {0.5, 0.5}, 0.2);
  ExpectLinks(2, walls, {9.5, 0.5}, {0.5, 1.5}, 0.2);
  ExpectLinks(3, walls, {9.5, 0.5}, {9.5, 1.5}, 0.2);
  ExpectLinks(4, walls, {9.5, 0.5}, {9.5, 2.5}, 0.2);
  ExpectLinks(5, walls, {9.5, 0.5}, {0.5, 2.5}, 0.2);
  ExpectLinks(9, walls, {9.5, 0.5}, {0.5, 4.5}, 0.2);
}

TEST(MinimumLinkPath, WallsInLineWithEachOtherLetNothingThrough) {
  // Rooms of 2 m x 2 m in a row above a corridor; all doors are in one wall, y = 2, from 0.8 to 1.2 m in
  // each.
  std::string walls = "0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n2,2,2,4\n4,2,4,4\n";
  walls += "0,2,0.8,2\n1.2,2,2.8,2\n3.2,2,4.8,2\n5.2,2,6,2\n";
  for (const double radius : {0.0, 0.1}) {
    // Out into the corridor, and in again: from places that see the far end of the corridor through their
    // doors.
    ExpectLinks(2, walls, {1, 3.8}, {3, 0.5}, radius);
    ExpectLinks(3, walls, {1, 3.8}, {3, 3.8}, radius);
    ExpectLinks(3, walls, {1, 3.8}, {5, 3.8}, radius);
  }
  // Around the end of the wall beside both places: a point turns on its other side, a disc goes across the
  // door.
  ExpectLinks(2, walls, {0.2, 2.2}, {0.2, 1.8}, 0);
  ExpectLinks(3, walls, {0.2, 2.2}, {0.2, 1.8}, 0.1);
}

TEST(MinimumLinkPath, GoesAroundAHoleInAPolygon) {
  // A square ring, 1 m wide, around a hole.
  const std::string ring =
      decompose_views::PolygonText({{{0, 0}, {6, 0}, {6, 6}, {0, 6}}, {{1, 1}, {1, 5}, {5, 5}, {5, 1}}});
  for (const double radius : {0.0, 0.3}) {
    ExpectLinks(1, ring, {0.5, 0.5}, {5.5, 0.5}, radius);
    ExpectLinks(2, ring, {0.5, 0.5}, {5.5, 5.5}, radius);
    ExpectLinks(3, ring, {0.5, 3}, {5.5, 3}, radius);
  }
}

TEST(MinimumLinkPath, IsNotBelowBruteForceNorAboveIt) {
  constexpr int kSize = 6;
  int num_ways = 0, num_optimal = 0, num_more_than_two = 0, num_better_than_turns_at_corners = 0;
  for (uint64_t seed = 0; seed < 120; ++seed) {
    Random random(MixSeed(23, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(4, 10)), kSize));
    const Views views = decompose_views::Decomposed(oracle.Text(), decompose_views::FineGrid()).views;
    const PlanSpace space(views);
    for (const double radius : {0.0, random.Uniform(0.05, 0.3)}) {
      const Vec2 from(random.Uniform(-0.8, kSize + 0.8), random.Uniform(-0.8, kSize + 0.8));
      const Vec2 to(random.Uniform(-0.8, kSize + 0.8), random.Uniform(-0.8, kSize + 0.8));
      SCOPED_TRACE(fmt::format("seed {} radius {}: {},{} to {},{}\n{}", seed, radius, from.x(), from.y(),
                               to.x(), to.y(), oracle.Text()));
      const auto found = FindMinimumLinkPath(space, from, to, {.radius_m = radius});
      if (!found.ok()) continue;
      ++num_ways;
      num_optimal += found->is_optimal();
      num_more_than_two += found->fewest_links > 2;
      num_better_than_turns_at_corners +=
          found->path.num_links() < FindPath(space, from, to, {.radius_m = radius})->num_links();
      EXPECT_LE(found->fewest_links, found->path.num_links());
      // Touching nothing counts: lattices have few places in line with walls.
      const auto brute_force = oracle.FewestLinks(from, to, oracle.Lattice(0.23, radius), radius);
      if (brute_force) EXPECT_LE(found->fewest_links, *brute_force);
      const double wider = radius > 0 ? 1.01 * radius : 1e-4;
      const auto wider_path = oracle.FewestLinks(from, to, oracle.Lattice(0.23, wider), wider);
      if (wider_path) EXPECT_LE(found->path.num_links(), *wider_path);
    }
  }
  EXPECT_GT(num_ways, 120);
  EXPECT_GE(num_optimal, 0.97 * num_ways);
  EXPECT_GT(num_more_than_two, 15);
  EXPECT_GT(num_better_than_turns_at_corners, 5);
}

}  // namespace
}  // namespace cairn
