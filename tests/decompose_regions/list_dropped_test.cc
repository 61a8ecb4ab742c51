#include "stages/decompose_regions/list_dropped.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/decompose_regions/decompose_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::ElementsAre;

DroppedItem Dropped(DropReason reason, int64_t item_id, int64_t found) {
  return {.reason = reason, .item_id = item_id, .found = found};
}

TEST(ListDropped, NamesFeaturesAndStationsWithTheirReason) {
  //   station   0 1 2 3 4 5 6
  //   feature 0 # # # # . . .   kept by region {0, 1, 2, 3}
  //   feature 1 # # # # # . .   kept
  //   feature 2 # # # # . . .   not chosen
  //   feature 3 . . . # # . .   not common: no region lies in its area
  //   feature 4 . . . . # # .   not common
  const World world =
      AsciiWorld({"ooooooo"}, {{"####..."}, {"#####.."}, {"####..."}, {"...##.."}, {"....##."}});
  Decomposition decomposition;
  decomposition.k = 2;
  decomposition.tau = 1;
  decomposition.regions = {{.features = {0, 1}, .stations = {0, 1, 2, 3}}};
  // Station 3 sees four features, of which only 1 is seen from 2 and from 4.
  EXPECT_THAT(
      ListDropped(world, decomposition),
      ElementsAre(Dropped(DropReason::kNotChosen, 2, 4), Dropped(DropReason::kNotCommon, 3, 2),
                  Dropped(DropReason::kNotCommon, 4, 2), Dropped(DropReason::kFewCommonFeatures, 3, 4),
                  Dropped(DropReason::kFewCommonFeatures, 4, 3), Dropped(DropReason::kFewFeatures, 5, 1),
                  Dropped(DropReason::kFewFeatures, 6, 0)));
}

TEST(ListDropped, RemaindersThatRhoLetsGoAreLeftOver) {
  const World world = AsciiWorld({"oooooooooo"}, {{"####......"}, {"....###..."}, {".......###"}});
  const Result<Decomposition> decomposition =
      DecomposeRegions(world, {.algorithm = "b2", .k = 1, .tau = 0, .rho = 3}, 0);
  ASSERT_TRUE(decomposition.ok());
  const std::vector<DroppedItem> items = ListDropped(world, *decomposition);
  std::vector<int64_t> left_over;
  for (const DroppedItem& item : items) {
    if (item.reason == DropReason::kLeftOver) left_over.push_back(item.item_id);
  }
  EXPECT_THAT(left_over, ElementsAre(4, 5, 6, 7, 8, 9));
}

// Whether all of N_tau(station) is in a set, by walking.
bool NeighbourhoodIsIn(const std::vector<std::vector<StationIdx>>& neighbours, StationIdx station, int tau,
                       const std::vector<StationIdx>& stations) {
  std::set<StationIdx> reached = {station};
  for (int hop = 0; hop < tau; ++hop) {
    for (const StationIdx from : std::set<StationIdx>(reached))
      reached.insert(neighbours[from].begin(), neighbours[from].end());
  }
  return std::includes(stations.begin(), stations.end(), reached.begin(), reached.end());
}

TEST(ListDropped, EveryFeatureAndStationOfRandomWorldsIsKeptOrDroppedOnceForTheReasonThatHolds) {
  const char* const algorithms[] = {"a1", "b1", "b2", "c", "best"};
  int num_tried = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const World world = RandomWorld(9, 7, 50, seed % 3 == 1, seed);
    const DecomposeRegionsOptions options{.algorithm = algorithms[seed % 5],
                                          .k = 2 + static_cast<int>(seed % 3),
                                          .tau = static_cast<int>(seed % 4) % 3,
                                          .rho = static_cast<int>(seed % 2)};
    const Result<Decomposition> decomposition = DecomposeRegions(world, options, seed);
    if (!decomposition.ok()) continue;
    ++num_tried;
    std::map<int64_t, DropReason> features, stations;
    for (const DroppedItem& item : ListDropped(world, *decomposition)) {
      const bool is_station = DescribeDropReason(item.reason).kind == DropKind::kStation;
      EXPECT_TRUE((is_station ? stations : features).emplace(item.item_id, item.reason).second);
    }
    std::set<FeatureIdx> kept;
    for (const Region& region : decomposition->regions)
      kept.insert(region.features.begin(), region.features.end());
    EXPECT_EQ(kept.size() + features.size(), static_cast<size_t>(world.num_features()));
    for (FeatureIdx feature = 0; feature < world.num_features(); ++feature) {
      const auto& area = world.areas[feature];
      const bool is_common = std::any_of(
          decomposition->regions.begin(), decomposition->regions.end(), [&](const Region& region) {
            return std::includes(area.begin(), area.end(), region.stations.begin(), region.stations.end());
          });
      ASSERT_EQ(features.count(feature), kept.count(feature) == 0 ? 1u : 0u);
      if (kept.count(feature) > 0) continue;
      EXPECT_EQ(features[feature], is_common ? DropReason::kNotChosen : DropReason::kNotCommon);
    }
    const auto neighbours = AdjacencyLists(world);
    const auto sets = VisibilitySets(world);
    const std::vector<StationIdx> coverable = CoverableStations(world, options.k, options.tau);
    for (StationIdx station = 0; station < world.num_stations(); ++station) {
      const bool is_covered = std::any_of(
          decomposition->regions.begin(), decomposition->regions.end(), [&](const Region& region) {
            return NeighbourhoodIsIn(neighbours, station, options.tau, region.stations);
          });
      ASSERT_EQ(stations.count(station), is_covered ? 0u : 1u);
      if (is_covered) continue;
      const bool is_coverable = std::binary_search(coverable.begin(), coverable.end(), station);
      EXPECT_EQ(stations[station], is_coverable ? DropReason::kLeftOver
                                   : static_cast<int>(sets[station].size()) < options.k
                                       ? DropReason::kFewFeatures
                                       : DropReason::kFewCommonFeatures);
    }
  }
  EXPECT_GT(num_tried, 40);
}

}  // namespace
}  // namespace cairn::decompose_regions
