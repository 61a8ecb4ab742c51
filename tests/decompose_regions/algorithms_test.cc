// The six algorithms are six: each does what its figure says, and none what another's says.
#include "stages/decompose_regions/algorithms/algorithms.h"

#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/worlds/simulate_worlds.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "tests/decompose_regions/ascii_world.h"
#include "tests/decompose_regions/paper_algorithms.h"

namespace cairn::decompose_regions {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::array kSixAlgorithms = {"a1", "a2", "a3", "b1", "b2", "c"};

std::vector<int> InverseOf(const std::vector<int32_t>& ranks) {
  std::vector<int> order(ranks.size());
  for (size_t i = 0; i < ranks.size(); ++i) order[ranks[i]] = static_cast<int>(i);
  return order;
}

// The order in which the stage settles ties: this, and nothing else of it, reaches the oracle.
PaperTies TiesOf(const World& world, const DecomposeRegionsOptions& options, uint64_t seed) {
  PaperTies ties;
  ties.stations = InverseOf(RandomRanks(world.num_stations(), seed));
  ties.drawn = RandomRanks(world.num_stations(), seed + 1);
  std::set<FeatureIdx> is_in;
  for (const FeatureIdx feature : ReduceWorld(world, options.k, options.tau, seed).original) {
    if (is_in.insert(feature).second) ties.features.push_back(feature);
  }
  for (FeatureIdx feature = 0; feature < world.num_features(); ++feature) {
    if (!is_in.count(feature)) ties.features.push_back(feature);
  }
  return ties;
}

Decomposition ByThePaper(const World& world, const DecomposeRegionsOptions& options, uint64_t seed) {
  return PaperAlgorithms(world, options, TiesOf(world, options, seed)).Run();
}

void ExpectSame(const Decomposition& found, const Decomposition& expected) {
  ASSERT_EQ(found.regions.size(), expected.regions.size());
  for (size_t i = 0; i < found.regions.size(); ++i) {
    EXPECT_EQ(found.regions[i].stations, expected.regions[i].stations) << "region " << i;
    EXPECT_EQ(found.regions[i].features, expected.regions[i].features) << "region " << i;
  }
  EXPECT_EQ(found.uncovered, expected.uncovered);
}

TEST(Algorithms, AgreeWithTheirFiguresOnRandomWorlds) {
  int num_compared = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const World world = RandomWorld(11, 8, 50, seed % 2 == 1, seed);
    DecomposeRegionsOptions options{.k = 1 + static_cast<int>(seed % 4),
                                    .tau = static_cast<int>(seed / 4 % 2),
                                    .rho = std::array{0, 1, 3}[seed % 3]};
    options.alpha = std::array{0.5, 0.75, 0.85, 1.0}[seed / 8 % 4];
    if (CoverableStations(world, options.k, options.tau).empty()) continue;
    for (const char* algorithm : kSixAlgorithms) {
      SCOPED_TRACE(testing::Message() << algorithm << " seed " << seed);
      options.algorithm = algorithm;
      const Result<Decomposition> found = DecomposeRegions(world, options, seed);
      const Decomposition expected = ByThePaper(world, options, seed);
      ASSERT_EQ(found.ok(), !expected.regions.empty());
      if (!found.ok()) continue;  // rho lets all regions go
      ExpectSame(*found, expected);
      ++num_compared;
    }
  }
  EXPECT_GT(num_compared, 300);
}

// tests/decompose_regions/golden_regions.csv: small worlds of all four settings, and
// what the six algorithms make of them.  A line: setting, seed, then for each algorithm regions and uncovered
// stations.
struct GoldenWorld {
  int setting = 0;
  uint64_t seed = 0;
  std::map<std::string, std::pair<size_t, size_t>> counts;
};

std::vector<GoldenWorld> ReadGolden() {
  std::ifstream file(GOLDEN_REGIONS);
  std::vector<GoldenWorld> worlds;
  std::string line;
  std::getline(file, line);  // names of the columns
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream numbers(line);
    GoldenWorld& world = worlds.emplace_back();
    numbers >> world.setting >> world.seed;
    for (const char* algorithm : kSixAlgorithms) {
      auto& [num_regions, num_uncovered] = world.counts[algorithm];
      numbers >> num_regions >> num_uncovered;
    }
    EXPECT_FALSE(numbers.fail()) << line;
  }
  return worlds;
}

// As `make reproduce` does, small: bench/regions/tables.cc --area-scale.
constexpr double kGoldenAreaScale = 0.1;
constexpr uint64_t kNumGoldenWorlds = 3;
const DecomposeRegionsOptions kGoldenOptions{.k = 4, .tau = 1, .rho = 2};

World SimulatedWorld(int setting, uint64_t seed) {
  const Result<World> world = sim::SimulateWorld({.setting = setting, .area_scale = kGoldenAreaScale}, seed);
  EXPECT_TRUE(world.ok());
  return world.ok() ? *world : World();
}

using Counts = std::pair<size_t, size_t>;
Counts CountsOf(const Decomposition& decomposition) {
  return {decomposition.regions.size(), decomposition.uncovered.size()};
}

TEST(Algorithms, GiveTheGoldenCountsOnSimulatedWorlds) {
  for (const GoldenWorld& counted : ReadGolden()) {
    const World world = SimulatedWorld(counted.setting, counted.seed);
    for (const char* algorithm : kSixAlgorithms) {
      SCOPED_TRACE(testing::Message()
                   << algorithm << ", setting " << counted.setting << " seed " << counted.seed);
      DecomposeRegionsOptions options = kGoldenOptions;
      options.algorithm = algorithm;
      const Decomposition found = Decompose(world, options, counted.seed);
      EXPECT_EQ(CountsOf(found), counted.counts.at(algorithm));
      if (counted.seed > 0) continue;  // the oracle takes seconds
      const Decomposition expected = ByThePaper(world, options, counted.seed);
      EXPECT_EQ(CountsOf(expected), counted.counts.at(algorithm));
      ExpectSame(found, expected);
    }
  }
}

// How the file was made: --gtest_also_run_disabled_tests --gtest_filter='*PrintCountsByThePaper'.
TEST(Algorithms, DISABLED_PrintCountsByThePaper) {
  for (int setting = 1; setting <= 4; ++setting) {
    for (uint64_t seed = 0; seed < kNumGoldenWorlds; ++seed) {
      const World world = SimulatedWorld(setting, seed);
      std::string line = fmt::format("{},{}", setting, seed);
      for (const char* algorithm : kSixAlgorithms) {
        DecomposeRegionsOptions options = kGoldenOptions;
        options.algorithm = algorithm;
        const Decomposition d = ByThePaper(world, options, seed);
        const auto [num_regions, num_uncovered] = CountsOf(d);
        line += fmt::format(",{},{}", num_regions, num_uncovered);
      }
      std::puts(line.c_str());
    }
  }
}

TEST(Algorithms, GoldenCountsTellAnyTwoApartInEverySetting) {
  std::map<int, std::vector<GoldenWorld>> by_setting;
  for (GoldenWorld& world : ReadGolden()) by_setting[world.setting].push_back(world);
  ASSERT_EQ(by_setting.size(), 4);
  for (const auto& [setting, worlds] : by_setting) {
    for (const std::string a : kSixAlgorithms) {
      for (const std::string b : kSixAlgorithms) {
        if (a == b) continue;
        EXPECT_TRUE(std::any_of(worlds.begin(), worlds.end(),
                                [&](const GoldenWorld& w) { return w.counts.at(a) != w.counts.at(b); }))
            << "setting " << setting << ": " << a << " and " << b;
      }
    }
  }
}

// Features of the regions, one each, in the order in which they were added.
std::vector<FeatureIdx> OrderOfFeatures(const Decomposition& decomposition) {
  std::vector<FeatureIdx> order;
  for (const Region& region : decomposition.regions) order.push_back(region.features[0]);
  return order;
}

// Stations that nothing joins, so that each is a region of its own.  Station v sees the features from
// first[v]:
//   station          0        1   2      3
//   features         0 1 2    3   4 5    6 7
World LoneStations() {
  return AsciiWorld({"o.o.o.o"}, {{"#......"},
                                  {"#......"},
                                  {"#......"},
                                  {"..#...."},
                                  {"....#.."},
                                  {"....#.."},
                                  {"......#"},
                                  {"......#"}});
}
std::vector<StationIdx> OrderOfStations(const char* algorithm, uint64_t seed) {
  const Decomposition d =
      Decompose(LoneStations(), {.algorithm = algorithm, .k = 1, .tau = 0, .rho = 0}, seed);
  std::vector<StationIdx> order;
  for (const Region& region : d.regions) order.push_back(region.stations[0]);
  return order;
}

TEST(Algorithms, A1GrowsFromTheStationWithTheFewestFeaturesAndBreaksTiesBySeed) {
  std::map<std::vector<StationIdx>, int> orders;
  for (uint64_t seed = 0; seed < 200; ++seed) ++orders[OrderOfStations("a1", seed)];
  ASSERT_EQ(orders.size(), 2);  // stations 2 and 3 see two features each
  EXPECT_GT((orders[{1, 2, 3, 0}]), 60);
  EXPECT_GT((orders[{1, 3, 2, 0}]), 60);
}

TEST(Algorithms, A2GrowsFromTheStationWithTheMostFeaturesAndBreaksTiesBySeed) {
  std::map<std::vector<StationIdx>, int> orders;
  for (uint64_t seed = 0; seed < 200; ++seed) ++orders[OrderOfStations("a2", seed)];
  ASSERT_EQ(orders.size(), 2);
  EXPECT_GT((orders[{0, 2, 3, 1}]), 60);
  EXPECT_GT((orders[{0, 3, 2, 1}]), 60);
}

TEST(Algorithms, A3GrowsFromStationsDrawnUniformlyByTheSeed) {
  constexpr int kNumSeeds = 4800;
  std::map<std::vector<StationIdx>, int> orders;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) ++orders[OrderOfStations("a3", seed)];
  ASSERT_EQ(orders.size(), 24);  // every order of four stations
  double chi_squared = 0;
  for (const auto& [order, count] : orders)
    chi_squared += std::pow(count - kNumSeeds / 24.0, 2) / (kNumSeeds / 24.0);
  EXPECT_LT(chi_squared, 49.7);  // of 23 degrees of freedom in 999 of 1000 cases
  EXPECT_EQ(OrderOfStations("a3", 5), OrderOfStations("a3", 5));
}

TEST(Algorithms, A3DrawsSeedsApartFromTies) {
  // The seed drawn first is not always the one that wins ties.
  int num_same = 0;
  constexpr int kNumSeeds = 2000;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    const PaperTies ties = TiesOf(LoneStations(), {.k = 1, .tau = 0}, seed);
    num_same += ties.stations[0] == ties.drawn[0];
  }
  EXPECT_NEAR(num_same, kNumSeeds / 4, 100);
}

// The middle may grow to either side, with one feature in common each way:   o o o
// feature 0                                                                   # # .
// feature 1                                                                   . # #
World Fork() { return AsciiWorld({"ooo"}, {{"##."}, {".##"}}); }

TEST(Algorithms, GrowthBreaksTiesBySeed) {
  int num_left = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    // A.2 begins in the middle.
    const Decomposition d = Decompose(Fork(), {.algorithm = "a2", .k = 1, .tau = 0, .rho = 0}, seed);
    ASSERT_EQ(d.regions.size(), 2);
    num_left += d.regions[0].features[0] == 0;
  }
  EXPECT_NEAR(num_left, 100, 40);
}

TEST(Algorithms, EquallyVisibleFeaturesAreChosenBySeed) {
  for (const char* algorithm : {"b1", "b2"}) {
    int num_left = 0;
    for (uint64_t seed = 0; seed < 200; ++seed) {
      num_left += OrderOfFeatures(
                      Decompose(Fork(), {.algorithm = algorithm, .k = 1, .tau = 0, .rho = 0}, seed))[0] == 0;
    }
    EXPECT_NEAR(num_left, 100, 40) << algorithm;
  }
  // C's disc is the corner of the row and the column (so many stations stand alone that r = 0), and both
  // features are seen from all of it:
  //   o o o o . o . o . o . o . o . o      0 # # # #     1 #       and one each for the lone stations
  //   o                                                    #
  //   o                                                    #
  //   o                                                    #
  const std::vector<std::string> stations = {"oooo.o.o.o.o.o.o.o.o", "o...................",
                                             "o...................", "o..................."};
  const std::string none(stations[0].size(), '.'), column = "#" + none.substr(1);
  std::vector<std::vector<std::string>> features = {{"####" + none.substr(4), none, none, none},
                                                    {column, column, column, column}};
  for (size_t at = 5; at < none.size(); at += 2) {
    features.push_back({none, none, none, none});
    features.back()[0][at] = '#';
  }
  const World corner = AsciiWorld(stations, features);
  int num_rows = 0;
  for (uint64_t seed = 0; seed < 200; ++seed)
    num_rows +=
        OrderOfFeatures(Decompose(corner, {.algorithm = "c", .k = 1, .tau = 0, .rho = 0}, seed))[0] == 0;
  EXPECT_NEAR(num_rows, 100, 40);
}

// The station above the row sees nothing.  Discs of two hops around it and around station 1 hold four
// stations, three of which are coverable and see feature 0 alone; the next disc with a common feature is that
// of station 5, which sees feature 1.
//   0                   . . . . . .        . . . . . .
//   1 2 3 4 5 6 [7]     # # # . . .        . . # # # #
World DiscsOfThreeInFour(int num_in_row) {
  const std::string none(num_in_row, '.');
  std::string above = none, left = none, right = none;
  above[1] = 'o';
  left.replace(0, 3, "###");
  right.replace(2, num_in_row - 2, std::string(num_in_row - 2, '#'));
  return AsciiWorld({above, std::string(num_in_row, 'o')}, {{none, left}, {none, right}});
}
FeatureIdx FirstOfC(const World& world, double alpha) {
  DecomposeRegionsOptions options{.algorithm = "c", .k = 1, .tau = 0, .rho = 0};
  options.alpha = alpha;
  return OrderOfFeatures(Decompose(world, options))[0];
}

TEST(Algorithms, AlphaIsTheLeastShareOfADiscThatIsOpen) {
  const World world = DiscsOfThreeInFour(7);
  EXPECT_EQ(FirstOfC(world, 0), 0);
  EXPECT_EQ(FirstOfC(world, 0.74), 0);
  EXPECT_EQ(FirstOfC(world, 0.75), 0);  // |C| >= alpha |N_r(v)|
  EXPECT_EQ(FirstOfC(world, 0.76), 1);
  EXPECT_EQ(FirstOfC(world, 1), 1);
  EXPECT_EQ(DecomposeRegionsOptions().alpha, 0.85);  // the source's
}

TEST(Algorithms, HalfOfTheStationsDecideTheRadiusOfDiscs) {
  // Each station has a largest radius at which its disc still has a common feature.  Row of seven: 2, 1, 0,
  // 1, 2, 3, 4; four of them, at least half, reach 2.  Row of six: 2, 1, 0, 1, 2, 3; three of them, half,
  // reach
  // 2.  With r = 1 the disc of station 1 would be whole, {1, 2}, and give feature 0 for any alpha; with r = 3
  // no disc before that of station 6 has a common feature, and its feature is 1.
  for (const int num_in_row : {6, 7}) {
    EXPECT_EQ(FirstOfC(DiscsOfThreeInFour(num_in_row), 0.75), 0) << num_in_row;
    EXPECT_EQ(FirstOfC(DiscsOfThreeInFour(num_in_row), 0.76), 1) << num_in_row;
  }
}

TEST(Algorithms, CTakesFeaturesOfTheDiscOnlyAndB1TheMostVisible) {
  // B.1 begins with feature 1, which four or five stations see; C with that of the first disc.
  const World world = DiscsOfThreeInFour(7);
  const DecomposeRegionsOptions options{.algorithm = "b1", .k = 1, .tau = 0, .rho = 0};
  EXPECT_THAT(OrderOfFeatures(Decompose(world, options)), ElementsAre(1, 0));
  EXPECT_EQ(FirstOfC(world, 0.5), 0);
}

TEST(Algorithms, RegionsGrowIntoOpenStationsFirst) {
  // A.1 begins at station 3, which sees least (feature 1), and takes 2 to 4.  Then station 0 (feature 0)
  // grows over 1; on the left of 2 nothing is open, and 2 itself joins though it is assigned.
  //   0 1 2 3 4
  //   # # # . .    feature 0
  //   . . # # #    feature 1
  //   . # . . .    features 2, 3: station 1 has three
  //   . # . . .
  //   . . . . #    feature 4: station 4 has two
  //   # . . . .    feature 5: station 0 has two
  const World world =
      AsciiWorld({"ooooo"}, {{"###.."}, {"..###"}, {".#..."}, {".#..."}, {"....#"}, {"#...."}});
  const Decomposition d = Decompose(world, {.algorithm = "a1", .k = 1, .tau = 0, .rho = 0});
  ASSERT_EQ(d.regions.size(), 2);
  EXPECT_THAT(d.regions[0].stations, ElementsAre(2, 3, 4));
  EXPECT_THAT(d.regions[1].stations, ElementsAre(0, 1, 2));
}

TEST(Algorithms, B2DropsRegionsWhileAllLossesTogetherStayBelowTheGain) {
  //             0         1         2         3
  //             0123456789012345678901234567890
  // M1, M2          ##########   ##########        chosen first, 10 stations each
  // L1, L2      #########             #########    gain 4 each; M1 and M2 keep 5 of their own
  // R                      #########               gains 3; M1 and M2 keep 2 of their own
  // R pushes out one of M1 and M2 (2 < 3) and not the other (2 + 2 >= 3).  The two stations that are open
  // again are no region of their own with rho = 2.
  const World world = AsciiWorld({std::string(31, 'o')}, {{"....##########................."},
                                                          {".................##########...."},
                                                          {"#########......................"},
                                                          {"......................#########"},
                                                          {"...........#########..........."}});
  const Decomposition b2 = Decompose(world, {.algorithm = "b2", .k = 1, .tau = 0, .rho = 2});
  EXPECT_EQ(b2.regions.size(), 4);
  EXPECT_EQ(b2.uncovered.size(), 2);
  const Decomposition b1 = Decompose(world, {.algorithm = "b1", .k = 1, .tau = 0, .rho = 2});
  EXPECT_EQ(b1.regions.size(), 5);
  EXPECT_THAT(b1.uncovered, IsEmpty());
}

TEST(DropRedundantRegions, TheLargestMinimumOverlapGoesFirst) {
  //               0 1 2 3 4 5
  // regions 0      # # # # . .     mu = 2
  //         1      . # # # . .     mu = 3: goes first
  //         2      # # . . . .     mu = 2
  //         3      . . # # # #     mu = 1
  // Then station 3 keeps regions 0 and 3, stations 0 and 1 have 0 and 2: of these, equal at mu = 2, the one
  // that was added first goes.
  const World world = AsciiWorld({"oooooo"}, {{"######"}});
  const ReducedWorld reduced = ReduceWorld(world, 1, 0, 0);
  const std::vector<std::vector<StationIdx>> regions = {{0, 1, 2, 3}, {1, 2, 3}, {0, 1}, {2, 3, 4, 5}};
  Cover cover(reduced, -1);  // keeps all, also those that cover nothing new
  for (const std::vector<StationIdx>& stations : regions) cover.Add({{0}, stations});
  DropRedundantRegions(&cover);
  EXPECT_TRUE(cover.IsDropped(0));
  EXPECT_TRUE(cover.IsDropped(1));
  EXPECT_FALSE(cover.IsDropped(2));
  EXPECT_FALSE(cover.IsDropped(3));
}

TEST(RandomRanks, AreAPermutationBySeed) {
  const std::vector<int32_t> ranks = RandomRanks(50, 3);
  EXPECT_EQ(std::set<int32_t>(ranks.begin(), ranks.end()).size(), 50);
  EXPECT_EQ(*std::max_element(ranks.begin(), ranks.end()), 49);
  EXPECT_EQ(RandomRanks(50, 3), ranks);
  EXPECT_NE(RandomRanks(50, 4), ranks);
}

}  // namespace
}  // namespace cairn::decompose_regions
