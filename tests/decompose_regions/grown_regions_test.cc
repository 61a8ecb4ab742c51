// What becomes of cores when they grow, and what is covered where limits are just met.
#include <optional>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/decompose_regions/check_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;

constexpr const char* kEachAlgorithm[] = {"a1", "a2", "a3", "b1", "b2", "c", "best"};

// All but the last station, at the end of the arm, see the feature, and so those up to tau hops from it are
// not coverable.  The arm is as long as tau: the crossing is not coverable, and the cores on its left and
// on its right are not connected.
//   0 1 2 3
//       |
//       b      tau = 1
World CrossingWithABlindArm(int tau) {
  std::vector<std::string> stations = {"oooo"}, feature = {"####"};
  for (int hop = 1; hop <= tau; ++hop) {
    stations.emplace_back("..o.");
    feature.emplace_back(hop < tau ? "..#." : "....");
  }
  return AsciiWorld(stations, {feature});
}

// Grown by one hop, each of the two cores reaches the crossing and not the other side: two regions, unless an
// algorithm joins them, as "best" does.  Grown by two or more, one core reaches all that the other needs.
TEST(DecomposeRegions, CoreThatGrowsOverWhatAnotherNeedsStandsForBoth) {
  for (const char* algorithm : kEachAlgorithm) {
    for (const int tau : {1, 2, 3, 4}) {
      const World world = CrossingWithABlindArm(tau);
      ASSERT_THAT(CoverableStations(world, 1, tau), ElementsAre(0, 1, 3));
      const Decomposition d = Decompose(world, {.algorithm = algorithm, .k = 1, .tau = tau, .rho = 0});
      const bool are_two = tau == 1 && algorithm != std::string_view("best");
      EXPECT_EQ(d.regions.size(), are_two ? 2u : 1u) << algorithm << ", tau = " << tau;
      EXPECT_THAT(d.uncovered, IsEmpty());
      EXPECT_THAT(CheckRegions(world, d).violations, IsEmpty()) << algorithm << ", tau = " << tau;
    }
  }
}

// rho = 3 lets the features of three stations each go, and they make a hole of six: as large as it may be.
//   # # # # . . . . . .
//   . . . . # # # . . .
//   . . . . . . . # # #
TEST(DecomposeRegions, HolesMayBeAsLargeAsTheirLimit) {
  const World world = AsciiWorld({"oooooooooo"}, {{"####......"}, {"....###..."}, {".......###"}});
  for (const char* algorithm : kEachAlgorithm) {
    for (const auto& [max_hole, num_regions] : {std::pair(6, 1u), std::pair(3, 2u), std::pair(2, 3u)}) {
      const Decomposition d =
          Decompose(world, {.algorithm = algorithm, .k = 1, .tau = 0, .rho = 3, .max_hole = max_hole});
      EXPECT_EQ(d.regions.size(), num_regions) << algorithm << ", at most " << max_hole;
    }
  }
}

// No region has more than two of the four stations, so two are the fewest, which counting sees, too.
//   # # . .
//   . . # #
TEST(DecomposeRegions, BoundIsTheOneThatIsAskedFor) {
  const World world = AsciiWorld({"oooo"}, {{"##.."}, {"..##"}});
  const auto bound = [&](const char* algorithm, const char* lower_bound) {
    return Decompose(world, {.algorithm = algorithm, .k = 1, .tau = 0, .rho = 0, .lower_bound = lower_bound})
        .lower_bound;
  };
  for (const char* algorithm : kEachAlgorithm) {
    EXPECT_EQ(bound(algorithm, "certified"), 2) << algorithm;
    EXPECT_EQ(bound(algorithm, "auto"), 2) << algorithm;
    EXPECT_EQ(bound(algorithm, "counted"), 2) << algorithm;
    EXPECT_EQ(bound(algorithm, "none"), std::nullopt) << algorithm;
  }
}

// A feature for any two stations that stand beside each other, so that the row is one part of the world, and
// more of them than "best" covers at once: what 120 regions cover.
//   # # . . .
//   . # # . .   and so on
TEST(DecomposeRegions, BoundOfALargeWorldIsCertifiedWhereItIsAskedFor) {
  constexpr int kNumRegions = 150;
  World world = AsciiWorld({std::string(2 * kNumRegions, 'o')}, {});
  for (StationIdx station = 0; station + 1 < 2 * kNumRegions; ++station)
    world.areas.push_back({station, station + 1});
  for (const char* lower_bound : {"auto", "certified"}) {
    const Decomposition d = Decompose(world, {.algorithm = "best",
                                              .k = 1,
                                              .tau = 0,
                                              .rho = 0,
                                              .lower_bound = lower_bound,
                                              .best_window_stations = 1});
    EXPECT_GE(d.regions.size(), static_cast<size_t>(kNumRegions));
    EXPECT_EQ(d.lower_bound, kNumRegions) << lower_bound;
  }
}

TEST(DecomposeRegions, WorldOfOneStationIsARegion) {
  for (const char* algorithm : kEachAlgorithm) {
    const Decomposition d =
        Decompose(AsciiWorld({"o"}, {{"#"}, {"#"}}), {.algorithm = algorithm, .k = 2, .tau = 1, .rho = 0});
    ASSERT_EQ(d.regions.size(), 1u) << algorithm;
    EXPECT_THAT(d.regions[0].stations, ElementsAre(0));
    EXPECT_THAT(d.regions[0].features, ElementsAre(0, 1));
  }
  const Result<Decomposition> none = DecomposeRegions(World(), {.k = 1}, 0);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
  EXPECT_THAT(none.error().message, StartsWith("the world has no station"));
}

}  // namespace
}  // namespace cairn::decompose_regions
