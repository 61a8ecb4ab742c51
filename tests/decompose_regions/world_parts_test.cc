#include "stages/decompose_regions/cover/world_parts.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/decompose_regions/algorithms/algorithm_best.h"
#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/cover/column_generation.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "tests/decompose_regions/all_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

ReducedWorld Wide(const World& world, int k, int tau) {
  return ReduceWorld(world, k, tau, 0, AreaSplit::kBeforeShrinking);
}

TEST(IndependentParts, EndWhereNeighboursSeeFewerThanKInCommon) {
  //   stations 0 1 2 3 4 5: two features are seen from 0 to 2, two from 2 to 5, one from everywhere
  const World world = AsciiWorld({"oooooo"}, {{"###..."}, {"###..."}, {"..####"}, {"..####"}, {"######"}});
  EXPECT_THAT(IndependentParts(Wide(world, 1, 0)), ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5)));
  EXPECT_THAT(IndependentParts(Wide(world, 3, 0)), ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5)));
  const World apart = AsciiWorld({"oooooo"}, {{"###..."}, {"###..."}, {"...###"}, {"...###"}, {"######"}});
  EXPECT_THAT(IndependentParts(Wide(apart, 1, 0)), ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5)));
  EXPECT_THAT(IndependentParts(Wide(apart, 2, 0)), ElementsAre(ElementsAre(0, 1, 2), ElementsAre(3, 4, 5)));
  // Nothing there is coverable.
  EXPECT_THAT(IndependentParts(Wide(apart, 4, 0)), IsEmpty());
}

TEST(IndependentParts, RegionsMayPassThroughStationsThatAreNotCoverable) {
  //   0 1 2 3 4 5 6: the niche 7 does not see the feature; with tau = 1 station 3 is not coverable
  const World world = AsciiWorld({"ooooooo", "...o..."}, {{"#######", "......."}});
  EXPECT_THAT(IndependentParts(Wide(world, 1, 1)), ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5, 6)));
}

TEST(WorldPart, IsTheWorldOfItsStations) {
  const World world = RandomWorld(9, 7, 40, false, 5);
  const ReducedWorld wide = Wide(world, 3, 1);
  std::vector<StationIdx> stations, open;
  for (StationIdx s = 0; s < world.num_stations(); ++s) {
    if (s % 5 == 0) continue;
    stations.push_back(s);
    if (wide.coverable[s] && s % 2 == 0) open.push_back(s);
  }
  ASSERT_GT(open.size(), 5u);
  const WorldPart part = CutOut(wide, stations, open);
  EXPECT_EQ(part.stations, stations);
  EXPECT_EQ(part.world.k, 3);
  EXPECT_EQ(part.world.num_stations(), static_cast<int>(stations.size()));
  EXPECT_EQ(part.world.num_coverable, static_cast<int>(open.size()));
  std::set<int32_t> seen;
  for (size_t i = 0; i < stations.size(); ++i) {
    const bool is_open = std::binary_search(open.begin(), open.end(), stations[i]);
    EXPECT_EQ(part.world.coverable[i] != 0, is_open);
    std::vector<StationIdx> neighbours;
    for (const StationIdx n : part.world.neighbours[static_cast<int>(i)]) neighbours.push_back(stations[n]);
    std::vector<StationIdx> expected;
    for (const StationIdx n : wide.neighbours[stations[i]]) {
      if (std::binary_search(stations.begin(), stations.end(), n)) expected.push_back(n);
    }
    EXPECT_EQ(neighbours, expected);
    const auto set = part.world.sets[static_cast<int>(i)];
    EXPECT_EQ(set.size(), is_open ? wide.sets[stations[i]].size() : 0u);
    for (const int32_t f : set) seen.insert(f);
  }
  EXPECT_EQ(seen.size(), part.features.size());
  for (size_t f = 0; f < part.features.size(); ++f) {
    EXPECT_EQ(part.world.original[f], wide.original[part.features[f]]);
    std::vector<StationIdx> whole, expected;
    for (const StationIdx s : part.world.whole_areas[static_cast<int>(f)]) whole.push_back(stations[s]);
    for (const StationIdx s : wide.whole_areas[part.features[f]]) {
      if (std::binary_search(stations.begin(), stations.end(), s)) expected.push_back(s);
    }
    EXPECT_EQ(whole, expected);
  }
  // What is not in the part is left out on the way into it.
  const CoreRegion core = {{0, 2}, {1, 3, 4}};
  const CoreRegion whole = part.InWhole(core);
  EXPECT_THAT(whole.features, ElementsAre(part.features[0], part.features[2]));
  EXPECT_THAT(whole.stations, ElementsAre(stations[1], stations[3], stations[4]));
  CoreRegion more = whole;
  more.stations.insert(more.stations.begin(), 0);
  EXPECT_EQ(part.InPart(more).stations, core.stations);
  EXPECT_EQ(part.InPart(more).features, core.features);
}

TEST(LeastNumberOfRegions, AddsWhatPartsNeed) {
  // 2.5 and 1.2 regions.
  const std::vector<Certificate> parts = {{50, 5, 20}, {12, 3, 10}};
  EXPECT_EQ(LeastNumberOfRegions(parts, 0), 3 + 2);
  // One station: worth a quarter of a region of the first part, 0.3 of one of the second, which has four.
  EXPECT_EQ(LeastNumberOfRegions(parts, 1), 4);  // 3.7 - 0.3
  EXPECT_EQ(LeastNumberOfRegions(parts, 3), 3);  // 3.7 - 0.9
  EXPECT_EQ(LeastNumberOfRegions(parts, 4), 3);  // 2.5
  EXPECT_EQ(LeastNumberOfRegions(parts, 6), 2);  // 2.5 - 2 * 0.25
  EXPECT_EQ(LeastNumberOfRegions(parts, 7), 2);
  EXPECT_EQ(LeastNumberOfRegions(parts, 13), 1);  // 2.5 - 9 * 0.25
  EXPECT_EQ(LeastNumberOfRegions(parts, 14), 0);
  // 1.2 - 8 * 0.02: of the second part's one region twelve stations leave nothing.
  EXPECT_EQ(LeastNumberOfRegions({{60, 1, 50}, {12, 1, 12}}, 20), 2);
  EXPECT_EQ(LeastNumberOfRegions({{40, 10, 20}}, 2), 1);  // exactly
  EXPECT_EQ(LeastNumberOfRegions({}, 0), 0);
  EXPECT_EQ(LeastNumberOfRegions({{50, 5, 0}, {12, 3, 10}}, 0), 2);  // of the first nothing is proven
}

Decomposition BestInWindows(const World& world, const Decomposition& start, int num_threads) {
  NoProgress progress;
  return AlgorithmBest(
      world, start,
      {.num_repairs = 10, .window_stations = 80, .window_regions = 3, .num_threads = num_threads}, start.seed,
      progress);
}

TEST(BestInWindows, IsValidAndNoWorseThanItsStartForAnyNumberOfThreads) {
  int num_start = 0, num_found = 0, num_at_once = 0, num_uncovered = 0;
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const World world = RandomWorld(16, 14, 120, seed % 2 == 1, seed);
    const int rho = seed % 3 == 0 ? 3 : 0;
    DecomposeRegionsOptions options{.algorithm = "b2", .k = 3, .tau = static_cast<int>(seed % 2), .rho = rho};
    const Result<Decomposition> start = DecomposeRegions(world, options, seed);
    ASSERT_TRUE(start.ok());
    const Decomposition found = BestInWindows(world, *start, 2);
    EXPECT_THAT(CheckRegions(world, found).violations, IsEmpty()) << seed;
    EXPECT_LE(found.regions.size(), start->regions.size());
    EXPECT_LE(found.uncovered.size(), start->uncovered.size());
    EXPECT_LE(*found.lower_bound, static_cast<int>(found.regions.size()));
    num_uncovered += static_cast<int>(found.uncovered.size());
    const Decomposition again = BestInWindows(world, *start, 1);
    ASSERT_EQ(again.regions.size(), found.regions.size());
    EXPECT_EQ(again.lower_bound, found.lower_bound);
    EXPECT_EQ(again.uncovered, found.uncovered);
    for (size_t r = 0; r < again.regions.size(); ++r) {
      EXPECT_EQ(again.regions[r].stations, found.regions[r].stations);
      EXPECT_EQ(again.regions[r].features, found.regions[r].features);
    }
    NoProgress progress;
    num_start += static_cast<int>(start->regions.size());
    num_found += static_cast<int>(found.regions.size());
    const Decomposition at_once = AlgorithmBest(world, *start, {}, seed, progress);
    num_at_once += static_cast<int>(at_once.regions.size());
    if (found.uncovered.size() == at_once.uncovered.size())
      EXPECT_NEAR(*found.lower_bound, *at_once.lower_bound, 1) << seed;
  }
  EXPECT_LT(num_found, num_start);
  EXPECT_GT(num_uncovered, 0);
  EXPECT_LE(2 * num_found, num_start + num_at_once);  // windows of few regions: more than half of the way
}

TEST(BestInWindows, LowerBoundsHold) {
  int num_parts = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const World world = RandomWorld(4, 3, 9, seed % 2 == 1, seed);
    const int k = 1 + static_cast<int>(seed % 3), tau = static_cast<int>(seed / 3 % 2);
    const AllRegions all(world, k, tau);
    const Result<Decomposition> start = DecomposeRegions(
        world, {.algorithm = "b2", .k = k, .tau = tau, .rho = static_cast<int>(seed % 4 / 2)}, seed);
    if (!start.ok()) continue;
    NoProgress progress;
    const Decomposition found =
        AlgorithmBest(world, *start, {.window_stations = 4, .window_regions = 0}, seed, progress);
    EXPECT_THAT(CheckRegions(world, found).violations, IsEmpty()) << seed;
    EXPECT_LE(*found.lower_bound, all.Fewest(static_cast<int>(found.uncovered.size()))) << seed;
    num_parts += static_cast<int>(IndependentParts(Wide(world, k, tau)).size());
  }
  EXPECT_GE(num_parts, 20);
}

TEST(BestInWindows, WhatIsStoppedIsAsGoodAsItsStart) {
  class StopsAfter : public Progress {
   public:
    explicit StopsAfter(int64_t limit) : limit_(limit) {}
    void Begin(std::string_view, int64_t, std::string_view) override {}
    void Advance(int64_t num_items) override { num_done_ += num_items; }
    void End() override {}
    bool Cancelled() const override { return num_done_ >= limit_; }

   private:
    int64_t limit_, num_done_ = 0;
  };
  const World world = RandomWorld(16, 14, 120, false, 1);
  const Result<Decomposition> start = DecomposeRegions(world, {.algorithm = "b2", .k = 3, .tau = 0}, 0);
  ASSERT_TRUE(start.ok());
  for (const int64_t limit : {0, 1, 40, 250}) {
    StopsAfter progress(limit);
    const Decomposition found = AlgorithmBest(
        world, *start, {.num_repairs = 10, .window_stations = 30, .window_regions = 3}, 0, progress);
    EXPECT_THAT(CheckRegions(world, found).violations, IsEmpty()) << limit;
    EXPECT_LE(found.regions.size(), start->regions.size());
    EXPECT_LE(found.uncovered.size(), start->uncovered.size());
  }
}

}  // namespace
}  // namespace cairn::decompose_regions
