#include "runtime/paths/search_path.h"

#include <numbers>

#include <gtest/gtest.h>

#include "runtime/paths/reached_part.h"
#include "tests/decompose_views/plan_fixture.h"
#include "tests/runtime/paths/plan_oracle.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

SearchPath Searched(const PlanSpace& space, const Vec2& from, const PlanPathOptions& options) {
  const auto search = FindSearchPath(space, from, options);
  EXPECT_TRUE(search.ok()) << search.error().message;
  return search.ok() ? *search : SearchPath{};
}

// What holds of all searches.
void ExpectSound(const PlanSpace& space, const SearchPath& search, const Vec2& from, double radius_m) {
  ASSERT_FALSE(search.places.empty());
  EXPECT_EQ(search.places[0], from);
  EXPECT_EQ(search.path.points[0], from);
  // Places are on the path, in their order.
  size_t next = 0;
  for (const Vec2& point : search.path.points)
    next += next < search.places.size() && point == search.places[next];
  EXPECT_EQ(next, search.places.size());
  for (size_t i = 0; radius_m > 0 && i + 1 < search.path.points.size(); ++i)
    EXPECT_TRUE(space.IsFree(search.path.points[i], search.path.points[i + 1], radius_m)) << i;
  // What they see, measured again.
  std::vector<ConvexPiece> hidden = FloorPieces(space);
  EXPECT_NEAR(AreaOf(hidden), search.domain_area_m2, 1e-9);
  for (const Vec2& place : search.places) hidden = LookAround(space, place).Hidden(hidden);
  EXPECT_NEAR(search.domain_area_m2 - AreaOf(hidden), search.seen_area_m2, 1e-6);
  double unseen = 0;
  for (const FloorPart& part : search.unseen) {
    EXPECT_NEAR(part.area_m2, AreaOf(part.pieces), 1e-12);
    EXPECT_GE(space.FaceAt(part.at), 0);
    unseen += part.area_m2;
  }
  for (size_t i = 0; i + 1 < search.unseen.size(); ++i)
    EXPECT_GE(search.unseen[i].area_m2, search.unseen[i + 1].area_m2);
  EXPECT_NEAR(unseen, search.unseen_area_m2(), 1e-9);
  EXPECT_LE(search.seen_area_m2, search.visible_area_m2 + 1e-9);
  EXPECT_GE(search.fewest_places, 1);
  EXPECT_LE(search.fewest_places, static_cast<int>(search.places.size()));
}

TEST(SearchPath, LooksAroundEachCornerOnce) {
  // A corridor 2 m wide in the shape of a U, 28 m2: from the end of one arm, one more look sees all the rest.
  const Views views =
      decompose_views::Decomposed(
          decompose_views::PolygonText({{{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 4}, {6, 4}, {6, 6}, {0, 6}}}))
          .views;
  const PlanSpace space(views);
  for (const double radius : {0.0, 0.1, 0.3}) {
    const SearchPath search = Searched(space, {5, 1}, {.radius_m = radius});
    ExpectSound(space, search, {5, 1}, radius);
    EXPECT_NEAR(search.domain_area_m2, 28, 1e-6);
    EXPECT_NEAR(search.visible_area_m2, 28, 1e-6);
    EXPECT_NEAR(search.seen_area_m2, 28, 1e-3);
    EXPECT_EQ(search.places.size(), 2u);
    EXPECT_EQ(search.fewest_places, 2);
    EXPECT_TRUE(search.unseen.empty());
    // Where the middle gets to: two arms, what is between them, and what is beside the circles at the inner
    // corners.
    const double wide = 2 - 2 * radius, arm = 6 - 2 * radius;
    const double reached =
        2 * arm * wide + wide * (arm - 2 * wide) + 2 * (1 - std::numbers::pi / 4) * radius * radius;
    EXPECT_NEAR(search.unreached_area_m2, 28 - reached, radius > 0 ? 0.5 : 1e-6) << radius;
  }
}

TEST(SearchPath, SaysWhatIsCutOff) {
  // Two rooms without a door: 4 m x 4 m, and 2 m x 4 m, with a wall in it.
  const Views views =
      decompose_views::Decomposed("0,0,6,0\n6,0,6,4\n6,4,0,4\n0,4,0,0\n4,0,4,4\n4,2,5,2").views;
  const PlanSpace space(views);
  for (const double radius : {0.0, 0.2}) {
    const SearchPath search = Searched(space, {1, 1}, {.radius_m = radius});
    ExpectSound(space, search, {1, 1}, radius);
    EXPECT_EQ(search.places.size(), 1u);
    EXPECT_EQ(search.fewest_places, 1);
    EXPECT_NEAR(search.seen_area_m2, 16, 1e-6);
    // The other room is one part; so is the floor around both, 1 m wide.
    ASSERT_EQ(search.unseen.size(), 2u);
    EXPECT_NEAR(search.unseen[0].area_m2, 8 * 6 - 24, 1e-3);
    EXPECT_NEAR(search.unseen[1].area_m2, 8, 1e-3);
    EXPECT_TRUE(search.unseen[1].at.x() > 4 && search.unseen[1].at.x() < 6);
    const double reached = radius > 0 ? 3.6 * 3.6 : 16;
    EXPECT_NEAR(search.unreached_area_m2, 48 - reached, radius > 0 ? 0.6 : 1e-6);
  }
}

TEST(SearchPath, SeesThroughADoorThatItDoesNotFitThrough) {
  // The room above is 4 m x 4 m; the door to the one below, 4 m x 2 m, is 0.3 m wide, in the middle.
  const Views views =
      decompose_views::Decomposed("0,0,4,0\n4,0,4,6\n4,6,0,6\n0,6,0,0\n0,2,1.85,2\n2.15,2,4,2").views;
  const PlanSpace space(views);
  const SearchPath search = Searched(space, {2, 5}, {.radius_m = 0.2});
  ExpectSound(space, search, {2, 5}, 0.2);
  // The lowest look past an end of the door is from (0.2, 2.2), and from the other side: below 0.2 m on 1.95
  // m.  What is above that line, beside either end, is not seen; nor is the floor around the rooms.
  const double slope = 0.2 / 1.95, wedge = 0.5 * 1.85 * (1.85 * slope);
  ASSERT_EQ(search.unseen.size(), 3u);
  EXPECT_NEAR(search.unseen[0].area_m2, 6 * 8 - 24, 1e-3);
  for (const size_t i : {1, 2}) {
    EXPECT_NEAR(search.unseen[i].area_m2, wedge, 0.02);
    EXPECT_GT(search.unseen[i].at.y(), 1.75);
    EXPECT_LT(search.unseen[i].at.y(), 2);
  }
  // What is not seen, no place that the robot gets to sees.
  const ReachedPart reached(space, 0.2, {2, 5});
  EXPECT_FALSE(reached.Contains({2, 1}));
  for (double x = 0.05; x < 4; x += 0.1) {
    for (double y = 2.05; y < 6; y += 0.1) {
      if (!reached.Contains({x, y})) continue;
      const LookAround look(space, {x, y});
      for (const FloorPart& part : search.unseen) EXPECT_FALSE(look.Sees(part.at));
    }
  }
}

TEST(SearchPath, AShareIsEnoughWhereItIsAskedFor) {
  const Views views =
      decompose_views::Decomposed(
          decompose_views::PolygonText({{{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 4}, {6, 4}, {6, 6}, {0, 6}}}))
          .views;
  const PlanSpace space(views);
  PlanPathOptions options{.radius_m = 0.1};
  options.seen_ratio = 0.3;
  const SearchPath search = Searched(space, {5, 1}, options);
  EXPECT_EQ(search.places.size(), 1u);
  EXPECT_EQ(search.fewest_places, 1);
  EXPECT_GT(search.seen_area_m2, 0.3 * 28);
  EXPECT_LT(search.seen_area_m2, 0.9 * 28);
  EXPECT_NEAR(search.visible_area_m2, 28, 1e-6);
}

TEST(SearchPath, FewPlacesOfManyRegionsToChooseFromSeeAllAsWell) {
  // Pillars, so that there are hundreds of regions.
  std::string walls = "0,0,8,0\n8,0,8,8\n8,8,0,8\n0,8,0,0\n";
  for (int x = 2; x < 8; x += 2) {
    for (int y = 2; y < 8; y += 2) walls += fmt::format("{},{},{},{}\n", x, y, x + 0.4, y + 0.1);
  }
  const Views views = decompose_views::Decomposed(walls).views;
  const PlanSpace space(views);
  for (const int num_places : {5, 40, 1500}) {
    PlanPathOptions options{.radius_m = 0.2};
    options.max_num_places = num_places;
    const SearchPath search = Searched(space, {1, 1}, options);
    ExpectSound(space, search, {1, 1}, 0.2);
    EXPECT_NEAR(search.visible_area_m2, 64, 1e-3);
    EXPECT_NEAR(search.seen_area_m2, 64, 0.01) << num_places;
    EXPECT_LT(search.places.size(), 12u);
  }
}

TEST(SearchPath, SeesWhatBruteForceSees) {
  constexpr int kSize = 5;
  int num_seen = 0, num_unseen = 0, num_missed = 0, num_searches = 0, num_closed = 0, num_bounds_tested = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    Random random(MixSeed(51, seed));
    const PlanOracle oracle(RandomWalls(random, static_cast<int>(random.UniformInt(4, 9)), kSize));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    const double radius = seed % 3 == 0 ? 0 : 0.25;
    const Vec2 from(random.Uniform(-0.7, kSize + 0.7), random.Uniform(-0.7, kSize + 0.7));
    if (oracle.Clearance(from, from) < radius + 0.01 || space.FaceAt(from) < 0) continue;
    SCOPED_TRACE(
        fmt::format("seed {} radius {} from {},{}\n{}", seed, radius, from.x(), from.y(), oracle.Text()));
    const SearchPath search = Searched(space, from, {.radius_m = radius});
    ExpectSound(space, search, from, radius);
    ++num_searches;
    num_closed += search.fewest_places == static_cast<int>(search.places.size());
    // Places that the robot gets to with a little to spare; what they see of the floor.
    const std::vector<Vec2> reached =
        oracle.ReachedOf(from, oracle.Lattice(0.29, 1.03 * radius + 1e-3), 1.03 * radius + 1e-3);
    for (int i = 0; i < 150; ++i) {
      const Vec2 point(random.Uniform(-0.9, kSize + 0.9), random.Uniform(-0.9, kSize + 0.9));
      const bool is_seen = std::any_of(search.places.begin(), search.places.end(),
                                       [&](const Vec2& place) { return oracle.Sees(place, point); });
      const bool can_be_seen = std::any_of(reached.begin(), reached.end(),
                                           [&](const Vec2& place) { return oracle.Sees(place, point); });
      num_seen += is_seen;
      num_unseen += !is_seen && !can_be_seen;
      num_missed += can_be_seen && !is_seen;
    }
    for (const FloorPart& part : search.unseen) {
      if (part.area_m2 < 0.02) continue;
      EXPECT_TRUE(std::none_of(reached.begin(), reached.end(), [&](const Vec2& place) {
        return oracle.Sees(place, part.at);
      })) << part.at.transpose();
    }
    // No single place, and no two, that brute force finds beside the start see all with less than the bound.
    std::vector<ConvexPiece> left = LookAround(space, from).Hidden(FloorPieces(space));
    const double cannot = search.unseen_area_m2();
    int fewest = AreaOf(left) <= cannot + 1e-6 ? 1 : 4;
    std::vector<std::pair<double, std::vector<ConvexPiece>>> after_two;
    for (size_t i = 0; i < reached.size() && fewest > 1; i += 2) {
      std::vector<ConvexPiece> rest = LookAround(space, reached[i]).Hidden(left);
      const double area = AreaOf(rest);
      if (area <= cannot + 1e-6) fewest = std::min(fewest, 2);
      after_two.emplace_back(area, std::move(rest));
    }
    std::stable_sort(after_two.begin(), after_two.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (size_t i = 0; i < std::min<size_t>(20, after_two.size()) && fewest > 3; ++i) {
      for (size_t k = 0; k < reached.size() && fewest > 3; k += 3) {
        if (AreaOf(LookAround(space, reached[k]).Hidden(after_two[i].second)) <= cannot + 1e-6) fewest = 3;
      }
    }
    if (fewest < 4) {
      ++num_bounds_tested;
      EXPECT_LE(search.fewest_places, fewest);
      // The greedy choice, improved, is near to what brute force finds.
      EXPECT_LE(static_cast<int>(search.places.size()), fewest + 1);
    }
  }
  EXPECT_GT(num_searches, 40);
  EXPECT_GT(num_seen, 3000);
  EXPECT_GT(num_unseen, 100);
  EXPECT_GT(num_bounds_tested, 5);
  EXPECT_GT(num_closed, 2);
  // Slivers.
  EXPECT_LE(num_missed, num_seen / 1000);
}

TEST(ReachedPart, IsWhereAPathLeads) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Random random(MixSeed(52, seed));
    const PlanOracle oracle(RandomWalls(random, 8, 5));
    const Views views = decompose_views::Decomposed(oracle.Text()).views;
    const PlanSpace space(views);
    const Vec2 from(random.Uniform(-0.7, 5.7), random.Uniform(-0.7, 5.7));
    for (const double radius : {0.0, 0.3}) {
      if (space.FaceAt(from) < 0 || !space.IsFree(from, from, radius)) continue;
      const ReachedPart reached(space, radius, from);
      int num_reached = 0, num_points = 0;
      for (double x = -0.93; x < 6; x += 0.39) {
        for (double y = -0.93; y < 6; y += 0.39) {
          num_points += space.FaceAt({x, y}) >= 0;
          const bool is_reached = FindPath(space, from, {x, y}, {.radius_m = radius}).ok();
          EXPECT_EQ(reached.Contains({x, y}), is_reached) << seed << " " << x << " " << y << "\n"
                                                          << oracle.Text();
          num_reached += is_reached;
        }
      }
      const double area = AreaOf(FloorPieces(space));
      EXPECT_NEAR(reached.Area() / area, static_cast<double>(num_reached) / num_points, 0.1);
    }
  }
}

}  // namespace
}  // namespace cairn
