#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/decompose_regions/algorithms/algorithm_best.h"
#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/cover/core_finder.h"
#include "stages/decompose_regions/cover/counting_bound.h"
#include "stages/decompose_regions/cover/cover_annealing.h"
#include "stages/decompose_regions/cover/exact_pricing.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "tests/decompose_regions/all_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::IsEmpty;

// Path, cycle, star, 3 x 3 grid, two separate paths, or a random graph, of nine stations.
std::vector<std::pair<StationIdx, StationIdx>> Edges(int shape, Random* random) {
  std::set<std::pair<StationIdx, StationIdx>> edges;
  for (StationIdx v = 1; v < 9; ++v) {
    if (shape == 2) edges.emplace(0, v);
    if (shape == 3 && v % 3 != 0) edges.emplace(v - 1, v);
    if (shape == 3 && v >= 3) edges.emplace(v - 3, v);
    if (shape <= 1 || (shape == 4 && v != 5)) edges.emplace(v - 1, v);
    if (shape == 5) edges.emplace(static_cast<StationIdx>(random->UniformInt(0, v - 1)), v);
  }
  if (shape == 1) edges.emplace(0, 8);
  for (int i = 0; shape == 5 && i < 4; ++i) {
    const auto u = static_cast<StationIdx>(random->UniformInt(0, 7));
    edges.emplace(u, static_cast<StationIdx>(random->UniformInt(u + 1, 8)));
  }
  return {edges.begin(), edges.end()};
}

// Nine stations and features whose areas are intervals of station numbers with or without holes, or anything.
World SmallWorld(uint64_t seed, int num_features = 7) {
  Random random(MixSeed(7, seed));
  World world;
  for (int v = 0; v < 9; ++v) world.positions.emplace_back(v % 3, v / 3);
  world.edges = Edges(static_cast<int>(seed % 6), &random);
  const double density = random.Uniform(0.5, 1.0);
  for (int feature = 0; feature < num_features; ++feature) {
    std::vector<StationIdx>& area = world.areas.emplace_back();
    const int64_t first = random.UniformInt(-4, 5), last = first + random.UniformInt(3, 9);
    for (StationIdx v = 0; v < 9; ++v) {
      const bool inside = seed % 2 == 0 || (v >= first && v <= last);
      if (inside && random.Uniform() < density) area.push_back(v);
    }
  }
  return world;
}

constexpr int kNumWorlds = 600;
int KOf(uint64_t seed) { return 1 + static_cast<int>(seed / 6 % 4); }
int TauOf(uint64_t seed) { return static_cast<int>(seed / 24 % 3); }
int RhoOf(uint64_t seed) { return static_cast<int>(seed / 72 % 4); }

TEST(LowerBound, NeverExceedsTheOptimumNorTheRegions) {
  int num_results = 0, num_best = 0, num_best_optimal = 0, num_tight = 0;
  for (uint64_t seed = 0; seed < kNumWorlds; ++seed) {
    const World world = SmallWorld(seed);
    ASSERT_TRUE(CheckWorld(world).ok());
    const AllRegions all(world, KOf(seed), TauOf(seed));
    for (const char* algorithm : {"a3", "b2", "best"}) {
      for (const char* bound : {"certified", "counted"}) {
        const DecomposeRegionsOptions options{.algorithm = algorithm,
                                              .k = KOf(seed),
                                              .tau = TauOf(seed),
                                              .rho = RhoOf(seed),
                                              .lower_bound = bound};
        const Result<Decomposition> result = DecomposeRegions(world, options, seed);
        if (!result.ok()) continue;
        ASSERT_THAT(CheckRegions(world, *result).violations, IsEmpty()) << algorithm << " seed " << seed;
        const int num_regions = static_cast<int>(result->regions.size());
        const int optimum = all.Fewest(static_cast<int>(result->uncovered.size()));
        ASSERT_LE(*result->lower_bound, optimum) << algorithm << " " << bound << " seed " << seed;
        ASSERT_LE(optimum, num_regions) << algorithm << " seed " << seed;
        ++num_results;
        if (options.algorithm != "best" || options.lower_bound != "certified") continue;
        ++num_best;
        num_best_optimal += num_regions == optimum;
        num_tight += *result->lower_bound == optimum;
      }
    }
  }
  RecordProperty("best", num_best);
  RecordProperty("best_optimal", num_best_optimal);
  RecordProperty("tight", num_tight);
  EXPECT_GE(num_results, 1000);
  EXPECT_GE(num_best_optimal, num_best * 95 / 100) << num_best;
  EXPECT_GE(num_tight, num_best * 80 / 100) << num_best;
}

// Bounds against the oracle for every number of uncovered stations.
void ExpectBounds(const World& world, int k, int tau, uint64_t seed) {
  const AllRegions all(world, k, tau);
  NoProgress progress;
  Result<Decomposition> result =
      DecomposeRegions(world, {.algorithm = "b2", .k = k, .tau = tau, .rho = 0}, seed);
  if (!result.ok()) return;
  const ReducedWorld reduced = ReduceWorld(world, k, tau, seed);
  const int num_coverable = static_cast<int>(CoverableStations(world, k, tau).size());
  for (int max_uncovered = 0; max_uncovered <= num_coverable; ++max_uncovered) {
    result->uncovered.assign(max_uncovered, 0);
    const int optimum = all.Fewest(max_uncovered);
    ASSERT_LE(CertifiedLowerBound(world, *result, 1, progress), optimum) << "seed " << seed;
    ASSERT_LE(CountingBound(reduced, max_uncovered), optimum) << "seed " << seed;
  }
}

TEST(LowerBound, HoldsForEveryNumberOfUncoveredStations) {
  for (uint64_t seed = 0; seed < kNumWorlds; ++seed) {
    ExpectBounds(SmallWorld(seed), KOf(seed), TauOf(seed), seed);
    if (seed % 4 == 0) ExpectBounds(SmallWorld(seed, 13), 5 + static_cast<int>(seed / 4 % 5), 0, seed);
  }
}

//   0 1 2 3 4 5 6    The row sees the feature, the niche 7 does not.  With tau = 1 station 3 is not
//   coverable, but a
//         7          region may pass through it: the row is one region, which covers 0 1 2 and 4 5 6.
TEST(LowerBound, RegionMayCoverStationsThatAreNotConnected) {
  const World world = AsciiWorld({"ooooooo", "...o..."}, {{"#######", "......."}});
  for (const char* algorithm : {"b2", "best"}) {
    const Result<Decomposition> result =
        DecomposeRegions(world, {.algorithm = algorithm, .k = 1, .tau = 1, .rho = 0}, 0);
    ASSERT_TRUE(result.ok());
    ASSERT_THAT(CheckRegions(world, *result).violations, IsEmpty());
    EXPECT_EQ(result->regions.size(), algorithm == std::string("best") ? 1 : 2);
    EXPECT_EQ(*result->lower_bound, 1);
  }
}

int64_t ValueOf(const std::vector<StationIdx>& stations, const StationValues& values) {
  int64_t value = 0;
  for (const StationIdx station : stations) value += values[station];
  return value;
}

// Exact pricing against the oracle, with values drawn from the seed.
void ExpectExact(const World& world, int k, int tau, uint64_t seed) {
  SCOPED_TRACE("seed " + std::to_string(seed));
  const ReducedWorld wide = ReduceWorld(world, k, tau, seed, AreaSplit::kBeforeShrinking);
  Random random(seed);
  StationValues values(9, 0);
  for (StationIdx v = 0; v < 9; ++v) {
    if (wide.coverable[v]) values[v] = random.UniformInt(0, 5);
  }
  const AllRegions all(world, k, tau);
  int64_t most = 0;
  for (const uint32_t cover : all.covers()) {
    int64_t value = 0;
    for (int v = 0; v < 9; ++v) value += cover >> v & 1 ? values[v] : 0;
    most = std::max(most, value);
  }
  ExactPricer pricer(wide);
  std::vector<CoreRegion> found;
  EXPECT_EQ(pricer.MaxValue(values, 0, 1000000, &found), most);
  int64_t most_found = 0;
  for (const CoreRegion& region : found) {
    most_found = std::max(most_found, ValueOf(region.stations, values));
    uint32_t cover = 0;
    for (const StationIdx station : region.stations) cover |= uint32_t{1} << station;
    EXPECT_EQ(all.covers().count(cover), 1);
    EXPECT_EQ(region.features.size(), k);
  }
  EXPECT_EQ(most_found, most);
  // A threshold just below the largest value finds it, the value itself finds nothing.
  for (const int64_t threshold : {most - 1, most, most + 1}) {
    if (threshold < 0) continue;
    found.clear();
    EXPECT_EQ(pricer.MaxValue(values, threshold, 1000000, &found), std::max(most, threshold));
    EXPECT_EQ(found.empty(), threshold >= most);
  }
  // Cut short it still is an upper bound.
  for (const int64_t max_work : {0, 10, 30, 100}) {
    EXPECT_GE(pricer.MaxValue(values, 0, max_work, &found), most);
  }
}

TEST(ExactPricer, FindsTheMostValuableRegionOfAll) {
  for (uint64_t seed = 0; seed < kNumWorlds; ++seed)
    ExpectExact(SmallWorld(seed), KOf(seed), TauOf(seed), seed);
}

TEST(ExactPricer, FindsTheMostValuableRegionOfManyFeatures) {
  for (uint64_t seed = 0; seed < 300; ++seed)
    ExpectExact(SmallWorld(seed, 13), 5 + static_cast<int>(seed % 5), static_cast<int>(seed / 30 % 2), seed);
}

//   0 1 2 3 4    One feature is seen from all, 70 from 0 1 2 and 70 from 2 3 4.  With k = 2 to 71 the three
//                stations on the right are the most valuable region, with k = 72 station 2 is the only one.
TEST(ExactPricer, TellsMoreFeaturesApartThanAWordHasBits) {
  std::vector<std::vector<std::string>> features = {{"#####"}};
  for (int i = 0; i < 70; ++i) {
    features.push_back({"###.."});
    features.push_back({"..###"});
  }
  const World world = AsciiWorld({"ooooo"}, features);
  const StationValues values = {1, 2, 4, 8, 16};
  for (const auto& [k, most] : {std::pair(1, 31), std::pair(2, 28), std::pair(71, 28), std::pair(72, 4)}) {
    const ReducedWorld wide = ReduceWorld(world, k, 0, 0, AreaSplit::kBeforeShrinking);
    std::vector<CoreRegion> found;
    EXPECT_EQ(ExactPricer(wide).MaxValue(values, 0, 1000000, &found), most) << k;
  }
}

//        nnn      From a niche n no feature is seen, so with tau = 1 no station x of the two corridors is
//   oooooxxxooo   coverable, but a region may pass through the corridor whose features are all in it.
//   oooLo   oRo
//   oooooxxxooo
//        nnn
TEST(ExactPricer, ChoosesFeaturesThatHoldARegionTogether) {
  const std::vector<std::string> stations = {".....nnn...", "ooooooooooo", "ooooo...ooo", "ooooooooooo",
                                             ".....nnn..."};
  const std::vector<std::string> lower = {"...........", "#####...###", "#####...###", "###########",
                                          "..........."};
  const std::vector<std::string> upper = {"...........", "###########", "#####...###", "#####...###",
                                          "..........."};
  // Seen in both corridors, but from the fewest stations.
  const std::vector<std::string> both = {"...........", "..#########", "..###...###", "..#########",
                                         "..........."};
  const StationIdx left = 3 + 11 + 3, right = 3 + 11 + 6;  // L and R
  struct Case {
    int k, num_each, num_both;
    int64_t most;
  };
  // k features of one corridor and both hold L and R together; those of different corridors do not.
  for (const auto& [k, num_each, num_both, most] :
       {Case{2, 1, 1, 2}, Case{3, 1, 1, 1}, Case{3, 2, 1, 2}, Case{4, 2, 2, 2}, Case{5, 2, 2, 1}}) {
    std::vector<std::vector<std::string>> features;
    for (int i = 0; i < num_each; ++i) features.insert(features.end(), {lower, upper});
    for (int i = 0; i < num_both; ++i) features.push_back(both);
    const World world = AsciiWorld(stations, features);
    for (uint64_t seed = 0; seed < 6; ++seed) {
      const ReducedWorld wide = ReduceWorld(world, k, 1, seed, AreaSplit::kBeforeShrinking);
      StationValues values(world.num_stations(), 0);
      values[left] = values[right] = 1;
      std::vector<CoreRegion> found;
      EXPECT_EQ(ExactPricer(wide).MaxValue(values, 0, 1000000, &found), most) << k << " seed " << seed;
      ASSERT_FALSE(found.empty());
      EXPECT_EQ(ValueOf(found[0].stations, values), most);
      EXPECT_EQ(found[0].features.size(), k);
    }
  }
}

// With k = 40 a region can give up few of a station's features; the bound must not be cut short there.
TEST(LowerBound, IsNearTheRegionsWhenManyFeaturesMustBeSeen) {
  int num_regions = 0, lower_bound = 0;
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const World world = RandomWorld(22, 18, 260, false, seed);
    for (const int k : {10, 40}) {
      const Result<Decomposition> best =
          DecomposeRegions(world, {.algorithm = "best", .k = k, .tau = 1, .rho = 3}, seed);
      ASSERT_TRUE(best.ok());
      num_regions += static_cast<int>(best->regions.size());
      lower_bound += *best->lower_bound;
    }
  }
  EXPECT_LE(num_regions, lower_bound * 1.1) << lower_bound;
}

TEST(Best, NeedsNoMoreRegionsThanB2AndLeavesNoMoreUncovered) {
  for (uint64_t seed = 0; seed < 12; ++seed) {
    const World world = RandomWorld(12, 10, 50, seed % 3 == 0, seed);
    DecomposeRegionsOptions options{.algorithm = "b2", .k = 1 + static_cast<int>(seed % 5)};
    options.tau = static_cast<int>(seed % 3);
    options.rho = static_cast<int>(seed % 4);
    const Result<Decomposition> b2 = DecomposeRegions(world, options, seed);
    if (!b2.ok()) continue;
    options.algorithm = "best";
    const Result<Decomposition> best = DecomposeRegions(world, options, seed);
    ASSERT_TRUE(best.ok());
    EXPECT_LE(best->regions.size(), b2->regions.size());
    EXPECT_LE(best->uncovered.size(), b2->uncovered.size());
    EXPECT_LE(*best->lower_bound, static_cast<int>(best->regions.size()));
  }
}

TEST(LowerBound, HoldsForTheHolesThatMaxHoleLeaves) {
  int num_results = 0;
  for (uint64_t seed = 0; seed < kNumWorlds; seed += 3) {
    const World world = SmallWorld(seed);
    const AllRegions all(world, KOf(seed), TauOf(seed));
    for (int max_hole = 0; max_hole <= 2; ++max_hole) {
      const DecomposeRegionsOptions options{.algorithm = "best",
                                            .k = KOf(seed),
                                            .tau = TauOf(seed),
                                            .rho = 1 + RhoOf(seed),
                                            .max_hole = max_hole};
      const Result<Decomposition> best = DecomposeRegions(world, options, seed);
      if (!best.ok()) continue;
      ASSERT_THAT(CheckRegions(world, *best, max_hole).violations, IsEmpty()) << "seed " << seed;
      const int optimum = all.Fewest(static_cast<int>(best->uncovered.size()));
      ASSERT_LE(*best->lower_bound, optimum) << "seed " << seed;
      ASSERT_LE(optimum, static_cast<int>(best->regions.size())) << "seed " << seed;
      ++num_results;
    }
  }
  EXPECT_GE(num_results, 200);
}

// 3 x 3 stations, each seen by one feature of its own, and by those of a row and a column; three regions are
// needed, and one covers all but six stations.
TEST(CoverAnnealing, FindsTheCoverThatLeavesFewestStationsUncovered) {
  RegionPool pool;
  for (StationIdx v = 0; v < 9; ++v) pool.Add({{}, {v}});
  for (StationIdx row = 0; row < 9; row += 3) pool.Add({{}, {row, row + 1, row + 2}});
  for (StationIdx column = 0; column < 3; ++column) pool.Add({{}, {column, column + 3, column + 6}});
  CoverAnnealing annealing(pool, std::vector<char>(9, 1));
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const std::vector<int> three = annealing.Search({0, 4, 8}, 2000, &random);
    std::set<StationIdx> covered;
    for (const int region : three) covered.insert(pool[region].stations.begin(), pool[region].stations.end());
    EXPECT_EQ(three.size(), 3);
    EXPECT_EQ(covered.size(), 9) << "seed " << seed;
    EXPECT_EQ(pool[annealing.Search({0}, 2000, &random)[0]].stations.size(), 3) << "seed " << seed;
  }
}

TEST(Best, LargeWorldsGetB2AndTheCountedBound) {
  const World world = RandomWorld(14, 12, 70, false, 1);
  const Result<Decomposition> b2 = DecomposeRegions(world, {.algorithm = "b2", .k = 3, .tau = 0}, 1);
  const Result<Decomposition> best =
      DecomposeRegions(world, {.algorithm = "best", .k = 3, .tau = 0, .best_max_stations = 20}, 1);
  ASSERT_TRUE(b2.ok() && best.ok());
  ASSERT_EQ(best->regions.size(), b2->regions.size());
  EXPECT_EQ(best->lower_bound, b2->lower_bound);
}

}  // namespace
}  // namespace cairn::decompose_regions
