#include "stages/decompose_regions/decompose_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <atomic>

#include "stages/decompose_regions/check_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const char* const kAlgorithms[] = {"a1", "a2", "a3", "b1", "b2", "c", "best"};

// Seven stations in a row:        0 1 2 3 4 5 6
// feature 0 is seen from          # # # # . . .
// feature 1                       # # # # # . .
// feature 2                       . . . # # # #
// feature 3                       . . # # # # #
World RowWorld() { return AsciiWorld({"ooooooo"}, {{"####..."}, {"#####.."}, {"...####"}, {"..#####"}}); }

TEST(DecomposeRegions, RowOfStationsNeedsTwoRegions) {
  for (const char* algorithm : {"b1", "b2"}) {
    const Decomposition d = Decompose(RowWorld(), {.algorithm = algorithm, .k = 2, .tau = 0, .rho = 0});
    ASSERT_EQ(d.regions.size(), 2) << algorithm;
    // Features 1 and 3 are seen from five stations each; the one that shrinks 1 least is 0 (to stations 0 to
    // 3), the one that shrinks 3 least is 2 (to 3 to 6).
    EXPECT_THAT(d.uncovered, IsEmpty());
    for (const Region& region : d.regions) EXPECT_EQ(region.stations.size(), 4);
  }
}

TEST(DecomposeRegions, OverlapShrinksAreasByAHop) {
  // With tau = 1, F' of station v is what v and its neighbours see: feature 0 shrinks to stations 0 to 2, 1
  // to 0 to 3, 2 to 4 to 6, 3 to 3 to 6.  Station 3 has only features 1 and 3 left, so k = 2 needs a third
  // region: {1, 3} at station 3, grown back to 2 to 4.
  const Decomposition d = Decompose(RowWorld(), {.algorithm = "b2", .k = 2, .tau = 1, .rho = 0});
  std::vector<Region> regions = d.regions;
  std::sort(regions.begin(), regions.end(),
            [](const Region& a, const Region& b) { return a.stations < b.stations; });
  ASSERT_EQ(regions.size(), 3);
  EXPECT_THAT(regions[0].stations, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(regions[0].features, ElementsAre(0, 1));
  EXPECT_THAT(regions[1].stations, ElementsAre(2, 3, 4));
  EXPECT_THAT(regions[1].features, ElementsAre(1, 3));
  EXPECT_THAT(regions[2].stations, ElementsAre(3, 4, 5, 6));
  EXPECT_THAT(regions[2].features, ElementsAre(2, 3));
}

TEST(DecomposeRegions, RhoLetsSmallRemaindersGo) {
  // The same world: the region of station 3 alone covers one station that nothing else covers.
  const Decomposition d = Decompose(RowWorld(), {.algorithm = "b1", .k = 2, .tau = 1, .rho = 1});
  EXPECT_EQ(d.regions.size(), 2);
  EXPECT_THAT(d.uncovered, ElementsAre(3));
  EXPECT_EQ(d.uncovered_limit, 1);
}

// Two features of three stations each, side by side; rho = 3 lets both go, and they make a hole of six:
//   0 1 2 3 4 5 6 7 8 9
//   # # # # . . . . . .
//   . . . . # # # . . .
//   . . . . . . . # # #
World WorldOfRemainders() {
  return AsciiWorld({"oooooooooo"}, {{"####......"}, {"....###..."}, {".......###"}});
}

TEST(DecomposeRegions, RejectedRemaindersAddUpToAHoleLargerThanRho) {
  for (const char* algorithm : kAlgorithms) {
    const Decomposition d =
        Decompose(WorldOfRemainders(), {.algorithm = algorithm, .k = 1, .tau = 0, .rho = 3});
    EXPECT_EQ(d.regions.size(), 1) << algorithm;
    EXPECT_EQ(CheckRegions(WorldOfRemainders(), d).largest_hole, 6) << algorithm;
  }
}

TEST(DecomposeRegions, MaxHoleBoundsHoles) {
  for (const char* algorithm : kAlgorithms) {
    DecomposeRegionsOptions options{.algorithm = algorithm, .k = 1, .tau = 0, .rho = 3, .max_hole = 5};
    const Decomposition d = Decompose(WorldOfRemainders(), options);
    // One of the two remainders becomes a region, and the other is small enough.
    EXPECT_EQ(d.regions.size(), 2) << algorithm;
    EXPECT_EQ(d.uncovered.size(), 3) << algorithm;
    EXPECT_THAT(CheckRegions(WorldOfRemainders(), d, 5).violations, IsEmpty()) << algorithm;
  }
}

TEST(DecomposeRegions, MaxHoleHoldsOnRandomWorlds) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const World world = RandomWorld(14, 10, 50, seed % 2 == 1, seed);
    const int max_hole = static_cast<int>(seed % 4);
    for (const char* algorithm : kAlgorithms) {
      const DecomposeRegionsOptions options{
          .algorithm = algorithm, .k = 2, .tau = static_cast<int>(seed % 3), .rho = 5, .max_hole = max_hole};
      const Result<Decomposition> result = DecomposeRegions(world, options, seed);
      if (!result.ok()) continue;  // nothing coverable
      EXPECT_THAT(CheckRegions(world, *result, max_hole).violations, IsEmpty())
          << algorithm << " seed " << seed;
    }
  }
}

// Cancels once as many stations are assigned as `limit`.  Stations are the first task; `best` has a
// second one.
class CancelAfter : public Progress {
 public:
  explicit CancelAfter(int64_t limit) : limit_(limit) {}
  void Begin(std::string_view, int64_t total, std::string_view) override {
    if (++num_tasks_ == 1) total_ = total;
    total_later_ += num_tasks_ > 1 ? total : 0;
  }
  void Advance(int64_t num_items) override { (num_tasks_ == 1 ? done_ : done_later_) += num_items; }
  void End() override {}
  bool Cancelled() const override { return done_ >= limit_; }
  int num_tasks_ = 0;
  std::atomic<int64_t> done_ = 0, done_later_ = 0;  // from any thread
  int64_t total_ = 0, total_later_ = 0;

 private:
  const int64_t limit_;
};

TEST(DecomposeRegions, ReportsEveryCoverableStationOnceAndStopsWhenCancelled) {
  const World world = RandomWorld(14, 10, 50, false, 3);
  for (const char* algorithm : kAlgorithms) {
    const DecomposeRegionsOptions options{.algorithm = algorithm, .k = 2, .tau = 0, .rho = 0};
    CancelAfter never(1000000);
    ASSERT_TRUE(DecomposeRegions(world, options, 0, 2, never).ok());
    EXPECT_EQ(never.done_, never.total_) << algorithm;
    EXPECT_EQ(never.num_tasks_, algorithm == std::string("best") ? 2 : 1);
    EXPECT_EQ(never.done_later_, never.total_later_);
    EXPECT_EQ(never.total_, static_cast<int64_t>(CoverableStations(world, 2, 0).size()));
    CancelAfter soon(1);
    const Result<Decomposition> result = DecomposeRegions(world, options, 0, 2, soon);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
    EXPECT_LT(soon.done_, soon.total_) << algorithm;
  }
}

TEST(DecomposeRegions, RegionOfUnconnectedStationsIsSplit) {
  // One feature is seen at both ends of the corridor: two regions, never one.
  const World world = AsciiWorld({"oooooo"}, {{"##..##"}});
  const Decomposition d = Decompose(world, {.algorithm = "b2", .k = 1, .tau = 0, .rho = 0});
  ASSERT_EQ(d.regions.size(), 2);
  for (const Region& region : d.regions) EXPECT_THAT(region.features, ElementsAre(0));
}

TEST(DecomposeRegions, PathsAroundAPillarKeepARegionWhole) {
  //   o o o      the middle of the room is a pillar: the ring of stations around it is connected
  //   o . o
  //   o o o
  const World world = AsciiWorld({"ooo", "o.o", "ooo"}, {{"###", "#.#", "###"}});
  for (const char* algorithm : kAlgorithms) {
    const Decomposition d = Decompose(world, {.algorithm = algorithm, .k = 1, .tau = 1, .rho = 0});
    ASSERT_EQ(d.regions.size(), 1) << algorithm;
    EXPECT_EQ(d.regions[0].stations.size(), 8);
  }
}

TEST(DecomposeRegions, B2PushesOutARegionThatALaterOneReplaces) {
  // Greedy takes the middle (6 stations) first, then left and right (3 new ones each), which leave it nothing
  // of its own.
  const World world = AsciiWorld({"oooooooooo"}, {{"..######.."}, {"#####....."}, {".....#####"}});
  const Decomposition b2 = Decompose(world, {.algorithm = "b2", .k = 1, .tau = 0, .rho = 0});
  EXPECT_EQ(b2.regions.size(), 2);
  // The others reach the same by the elimination of redundant regions.
  EXPECT_EQ(Decompose(world, {.algorithm = "b1", .k = 1, .tau = 0, .rho = 0}).regions.size(), 2);
}

TEST(DecomposeRegions, TauLargerThanTheGraphAsksForFeaturesSeenEverywhere) {
  World world = RowWorld();
  const DecomposeRegionsOptions options{.k = 1, .tau = 100, .rho = 0};
  EXPECT_THAT(DecomposeRegions(world, options, 0).error().message, HasSubstr("no station is coverable"));
  world.areas.push_back({0, 1, 2, 3, 4, 5, 6});
  const Decomposition d = Decompose(world, options);
  ASSERT_EQ(d.regions.size(), 1);
  EXPECT_EQ(d.regions[0].stations.size(), 7);
}

TEST(DecomposeRegions, NothingCoverableSaysWhichKWouldDo) {
  const Result<Decomposition> result = DecomposeRegions(RowWorld(), {.k = 1000000, .tau = 0}, 0);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kNoData);
  EXPECT_THAT(result.error().message, HasSubstr("station (3 at 3.00, 0.00) has 4; choose k <= 4"));
}

TEST(DecomposeRegions, WorldsWithNothingToCoverAreErrors) {
  EXPECT_THAT(DecomposeRegions(World(), {}, 0).error().message, HasSubstr("no station"));
  World blind = RowWorld();
  blind.areas.clear();
  EXPECT_THAT(DecomposeRegions(blind, {.k = 1}, 0).error().message, HasSubstr("no station is coverable"));
}

TEST(DecomposeRegions, NoRegionSpansUnconnectedPartsOfTheGraph) {
  //   o o . o    one feature, seen everywhere; a triangle besides, so that the graph is no lattice
  World world = AsciiWorld({"oo.o", "oo.o"}, {{"####", "####"}});
  world.edges.emplace_back(0, 4);
  std::sort(world.edges.begin(), world.edges.end());
  for (const char* algorithm : kAlgorithms) {
    const Decomposition d = Decompose(world, {.algorithm = algorithm, .k = 1, .tau = 1, .rho = 0});
    EXPECT_EQ(d.regions.size(), 2) << algorithm;
    EXPECT_THAT(CheckRegions(world, d).violations, IsEmpty()) << algorithm;
  }
}

TEST(DecomposeRegions, StationsWithManyNeighboursShrinkAreasToo) {
  // A hub joined to six stations; the feature is not seen from station 6: with tau = 1 only 1 to 5 keep it.
  World world;
  for (int i = 0; i < 7; ++i) world.positions.emplace_back(std::cos(i), i == 0 ? 5.0 : std::sin(i));
  for (StationIdx i = 1; i < 7; ++i) world.edges.emplace_back(0, i);
  world.areas = {{0, 1, 2, 3, 4, 5}};
  EXPECT_THAT(CoverableStations(world, 1, 1), ElementsAre(1, 2, 3, 4, 5));
  const Decomposition d = Decompose(world, {.algorithm = "b2", .k = 1, .tau = 1, .rho = 0});
  EXPECT_EQ(d.regions.size(), 5);  // {0, 1} to {0, 5}: without the hub their cores are not connected
}

TEST(DecomposeRegions, NoRegionLargeEnoughIsAnErrorNotAnEmptyResult) {
  for (const char* algorithm : kAlgorithms) {
    const Result<Decomposition> result =
        DecomposeRegions(RowWorld(), {.algorithm = algorithm, .k = 2, .tau = 0, .rho = 2000000000}, 0);
    ASSERT_FALSE(result.ok()) << algorithm;
    EXPECT_EQ(result.error().code, ErrorCode::kNoData);
    EXPECT_THAT(result.error().message, HasSubstr("rho = 2000000000 of the 7 coverable stations"));
  }
}

TEST(DecomposeRegions, NegativeKIsAnError) {
  const Result<Decomposition> result = DecomposeRegions(RowWorld(), {.k = -4}, 0);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(result.error().message, HasSubstr("k = -4"));
}

TEST(DecomposeRegions, EveryAlgorithmKeepsEveryPropertyOnRandomWorlds) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const World world = RandomWorld(12, 9, 60, seed % 2 == 1, seed);
    ASSERT_TRUE(CheckWorld(world).ok());
    for (const char* algorithm : kAlgorithms) {
      if (algorithm == std::string("best") && seed % 7 > 1) continue;  // it takes longest
      DecomposeRegionsOptions options{.algorithm = algorithm, .k = 1 + static_cast<int>(seed % 5 % 4)};
      options.tau = static_cast<int>(seed % 3);
      options.rho = seed % 5 == 0 ? 0 : 2;
      const Result<Decomposition> result = DecomposeRegions(world, options, seed);
      if (!result.ok()) {
        EXPECT_EQ(result.error().code, ErrorCode::kNoData);
        continue;
      }
      const RegionCheck check = CheckRegions(world, *result);
      EXPECT_THAT(check.violations, IsEmpty()) << algorithm << " seed " << seed;
      EXPECT_EQ(check.num_coverable,
                static_cast<int>(CoverableStations(world, options.k, options.tau).size()));
    }
  }
}

TEST(DecomposeRegions, SameSeedGivesTheSameResult) {
  const World world = RandomWorld(20, 15, 80, false, 1);
  for (const char* algorithm : kAlgorithms) {
    const DecomposeRegionsOptions options{.algorithm = algorithm, .k = 3, .tau = 0, .rho = 0};
    const Decomposition first = Decompose(world, options, 1), again = Decompose(world, options, 1);
    ASSERT_EQ(first.regions.size(), again.regions.size());
    for (size_t i = 0; i < first.regions.size(); ++i) {
      EXPECT_EQ(first.regions[i].stations, again.regions[i].stations);
      EXPECT_EQ(first.regions[i].features, again.regions[i].features);
    }
  }
}

TEST(CheckRegions, NamesEachPropertyThatFails) {
  const World world = RowWorld();
  const Decomposition good = Decompose(world, {.algorithm = "b2", .k = 2, .tau = 0, .rho = 0});
  ASSERT_THAT(CheckRegions(world, good).violations, IsEmpty());

  Decomposition bad = good;
  bad.regions[0].stations = {0, 6};
  EXPECT_THAT(CheckRegions(world, bad).violations, testing::Contains(HasSubstr("region 0 is not connected")));
  EXPECT_THAT(CheckRegions(world, bad).violations,
              testing::Contains(HasSubstr("is not visible from station")));

  bad = good;
  bad.regions[1].features.pop_back();
  EXPECT_THAT(CheckRegions(world, bad).violations,
              ElementsAre(HasSubstr("region 1 has 1 features, fewer than k = 2")));

  bad = good;
  bad.regions.pop_back();
  EXPECT_THAT(CheckRegions(world, bad).violations, testing::Contains(HasSubstr("not listed as uncovered")));
  EXPECT_THAT(CheckRegions(world, bad, 0).violations, testing::Contains(HasSubstr("larger than 0")));

  bad = good;
  bad.regions.push_back(bad.regions[0]);
  EXPECT_THAT(CheckRegions(world, bad).violations, testing::Contains(HasSubstr("region 2 is redundant")));

  bad = good;
  bad.regions[0].stations.push_back(99);
  EXPECT_THAT(CheckRegions(world, bad).violations, ElementsAre(HasSubstr("99 is outside of 0 to 6")));

  bad = good;
  bad.lower_bound = 3;
  EXPECT_THAT(CheckRegions(world, bad).violations, ElementsAre(HasSubstr("lower bound 3 exceeds")));
}

}  // namespace
}  // namespace cairn::decompose_regions
