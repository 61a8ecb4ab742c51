#include "stages/decompose_regions/decompose_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <atomic>
#include <functional>
#include <optional>

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

// The regions {0, 1, 2, 3} and {3, 4, 5, 6} of the row, which together cover it.
Decomposition TwoRegions() {
  return {.algorithm = "b2", .k = 2, .regions = {{{0, 1}, {0, 1, 2, 3}}, {{2, 3}, {3, 4, 5, 6}}}};
}
std::vector<std::string> Violations(const Decomposition& decomposition, int max_hole = -1) {
  return CheckRegions(RowWorld(), decomposition, max_hole).violations;
}

TEST(CheckRegions, NamesEveryNumberThatCannotBe) {
  const auto violations_of = [](const std::function<void(Decomposition*)>& spoil) {
    Decomposition decomposition = TwoRegions();
    spoil(&decomposition);
    return Violations(decomposition);
  };
  EXPECT_THAT(Violations(TwoRegions()), IsEmpty());
  EXPECT_THAT(violations_of([](Decomposition* d) { d->k = 0; }), ElementsAre("k = 0 is not positive"));
  EXPECT_THAT(violations_of([](Decomposition* d) { d->tau = -1; }), ElementsAre("tau = -1 is negative"));
  EXPECT_THAT(violations_of([](Decomposition* d) { d->regions[1].stations = {}; }),
              ElementsAre("region 1 has no station"));
  EXPECT_THAT(
      violations_of([](Decomposition* d) {
        d->regions[1].stations = {-1, 3, 7};
      }),
      ElementsAre("region 1: station: -1 is outside of 0 to 6", "region 1: station: 7 is outside of 0 to 6"));
  EXPECT_THAT(violations_of([](Decomposition* d) {
                d->regions[0].features = {0, 3, 4};
              }),
              ElementsAre("region 0: feature: 4 is outside of 0 to 3"));
  EXPECT_THAT(violations_of([](Decomposition* d) {
                d->regions[0].features = {1, 0, 2, 2};
              }),
              ElementsAre("region 0: feature: 0 is a duplicate or out of order",
                          "region 0: feature: 2 is a duplicate or out of order"));
  EXPECT_THAT(violations_of([](Decomposition* d) {
                d->uncovered = {6, 7};
              }),
              ElementsAre("uncovered station: 7 is outside of 0 to 6"));
  // What stands before it is none that it could be a duplicate of.
  EXPECT_THAT(violations_of([](Decomposition* d) {
                d->uncovered = {0, 0};
              }),
              ElementsAre("uncovered station: 0 is a duplicate or out of order"));
}

TEST(CheckRegions, SaysWhatOfARegionCannotBeReachedOrSeen) {
  Decomposition parted = TwoRegions();
  parted.regions[0].stations = {0, 1, 3};
  EXPECT_THAT(
      Violations(parted),
      testing::Contains("region 0 is not connected: 1 of its 3 stations cannot be reached from station 0"));
  Decomposition blind = TwoRegions();
  blind.regions[1] = {{0, 3}, {3, 4, 5, 6}};
  EXPECT_THAT(Violations(blind), ElementsAre("region 1: feature 0 is not visible from station 4"));
}

TEST(CheckRegions, TellsHolesFromStationsThatCannotBeCovered) {
  // With k = 2 and tau = 1 all stations but the ends' can be covered from their neighbours: station 3 has two
  // features in common with 2 and 4.
  Decomposition overlapping = TwoRegions();
  overlapping.tau = 1;
  overlapping.rho = 1;
  RegionCheck check = CheckRegions(RowWorld(), overlapping, 1);
  EXPECT_THAT(
      check.violations,
      ElementsAre("station 3 is not listed as uncovered, but no region contains its neighbourhood (1 such "
                  "differences)"));
  EXPECT_EQ(check.num_coverable, 7);
  EXPECT_EQ(check.num_uncovered, 1);
  EXPECT_EQ(check.largest_hole, 1);
  overlapping.uncovered = {3};
  EXPECT_THAT(Violations(overlapping, 1), IsEmpty());
  EXPECT_THAT(Violations(overlapping, 0),
              ElementsAre("a hole of 1 connected uncovered stations is larger than 0"));
  overlapping.rho = 0;
  EXPECT_THAT(Violations(overlapping),
              ElementsAre("1 coverable stations are uncovered although rho = 0; first: station 3"));
  Decomposition excused = TwoRegions();
  excused.uncovered = {4, 5};
  EXPECT_THAT(
      Violations(excused),
      ElementsAre(
          "station 4 is listed as uncovered, but it is covered or not coverable (2 such differences)"));
}

TEST(CheckRegions, TheLargestHoleIsThatOfConnectedStations) {
  // Region {3} leaves a hole on either side: stations 0 to 2, and 4 to 7.
  const World world = AsciiWorld({"oooooooo"}, {{"########"}});
  const Decomposition middle{
      .algorithm = "b2", .k = 1, .rho = 9, .regions = {{{0}, {3}}}, .uncovered = {0, 1, 2, 4, 5, 6, 7}};
  const RegionCheck check = CheckRegions(world, middle, 4);
  EXPECT_EQ(check.largest_hole, 4);
  EXPECT_THAT(check.violations, IsEmpty());
  EXPECT_THAT(CheckRegions(world, middle, 3).violations,
              ElementsAre("a hole of 4 connected uncovered stations is larger than 3"));
}

TEST(CheckRegions, ABoundIsAtMostTheRegionsForAsManyUncoveredStations) {
  Decomposition bounded = TwoRegions();
  bounded.lower_bound = 2;
  EXPECT_THAT(Violations(bounded), IsEmpty());
  bounded.lower_bound = 3;
  EXPECT_THAT(Violations(bounded), ElementsAre("the lower bound 3 exceeds the 2 regions"));
  bounded = {
      .algorithm = "b2", .k = 2, .rho = 3, .regions = {{{0, 1}, {0, 1, 2, 3}}}, .uncovered = {4, 5, 6}};
  bounded.lower_bound = 1;
  bounded.uncovered_limit = 3;
  EXPECT_THAT(Violations(bounded), IsEmpty());
  bounded.uncovered_limit = 2;
  EXPECT_THAT(Violations(bounded),
              ElementsAre("the lower bound allows 2 uncovered stations, but there are 3"));
}

TEST(CheckRegions, ARegionIsNeededForAStationThatNoOtherCovers) {
  Decomposition three = TwoRegions();
  three.regions.insert(three.regions.begin() + 1, Region{{1, 3}, {2, 3, 4}});
  EXPECT_THAT(Violations(three),
              ElementsAre("region 1 is redundant: every station that it covers is covered by another"));
}

TEST(DecomposeRegions, OptionsHaveTheRangesOfTheirComments) {
  const auto check = [](const DecomposeRegionsOptions& options) {
    DecomposeRegionsOptions checked = options;
    return CheckOptions(DescribeOptions(&checked)).ok();
  };
  EXPECT_TRUE(check({.k = 1,
                     .tau = 0,
                     .rho = 0,
                     .max_hole = -1,
                     .alpha = 0,
                     .best_exchanges_per_station = 0,
                     .best_num_repairs = 0,
                     .best_window_stations = 1,
                     .best_max_stations = 0}));
  EXPECT_TRUE(check({.alpha = 1}));
  EXPECT_FALSE(check({.k = 0}));
  EXPECT_FALSE(check({.tau = -1}));
  EXPECT_FALSE(check({.rho = -1}));
  EXPECT_FALSE(check({.max_hole = -2}));
  EXPECT_FALSE(check({.alpha = -0.01}));
  EXPECT_FALSE(check({.alpha = 1.01}));
  EXPECT_FALSE(check({.best_exchanges_per_station = -1}));
  EXPECT_FALSE(check({.best_num_repairs = -1}));
  EXPECT_FALSE(check({.best_window_stations = 0}));
  EXPECT_FALSE(check({.best_max_stations = -1}));
}

TEST(DecomposeRegions, LowerBoundIsOfTheKindThatIsAskedFor) {
  //     0        Each of the four arms sees a feature of its own, and the middle sees all four: every arm
  //     needs a
  //   1 2 3      region.  Counting knows only that a region covers two of the five, and finds three; the
  //     4        certified bound is four.
  const World world = AsciiWorld(
      {".o.", "ooo", ".o."},
      {{".#.", ".#.", "..."}, {"...", "##.", "..."}, {"...", ".##", "..."}, {"...", ".#.", ".#."}});
  const auto bound = [&](const char* algorithm, const char* lower_bound, int best_max_stations) {
    return Decompose(world, {.algorithm = algorithm,
                             .k = 1,
                             .tau = 0,
                             .lower_bound = lower_bound,
                             .best_max_stations = best_max_stations})
        .lower_bound;
  };
  for (const char* algorithm : kAlgorithms) {
    EXPECT_EQ(bound(algorithm, "certified", 5), 4) << algorithm;
    EXPECT_EQ(bound(algorithm, "counted", 5), 3) << algorithm;
    EXPECT_EQ(bound(algorithm, "auto", 5), algorithm == std::string("best") ? 4 : 3) << algorithm;
    EXPECT_EQ(bound(algorithm, "none", 5), std::nullopt) << algorithm;
    EXPECT_EQ(bound(algorithm, "certified", 4), 3) << algorithm;
    EXPECT_EQ(bound(algorithm, "auto", 4), 3) << algorithm;
    EXPECT_EQ(bound(algorithm, "none", 4), std::nullopt) << algorithm;
  }
}

TEST(DecomposeRegions, NothingCommonWithinTauHopsSaysSo) {
  World world = RowWorld();
  const Result<Decomposition> result = DecomposeRegions(world, {.k = 1, .tau = 100}, 0);
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(
      result.error().message,
      HasSubstr("no feature is visible from all stations within tau = 100 hops of any of the 7 stations"));
}

TEST(DecomposeRegions, ResultNamesWhatItWasMadeWith) {
  const Decomposition d = Decompose(RowWorld(), {.algorithm = "a3", .k = 2, .tau = 1, .rho = 1}, 77);
  EXPECT_EQ(d.algorithm, "a3");
  EXPECT_EQ(d.k, 2);
  EXPECT_EQ(d.tau, 1);
  EXPECT_EQ(d.rho, 1);
  EXPECT_EQ(d.seed, 77);
}

}  // namespace
}  // namespace cairn::decompose_regions
