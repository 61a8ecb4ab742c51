#include "stages/decompose_regions/list_dropped.h"

#include <algorithm>

#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {
namespace {

// Features that some region keeps, as flags.
std::vector<char> KeptFeatures(const World& world, const Decomposition& decomposition) {
  std::vector<char> kept(world.num_features(), 0);
  for (const Region& region : decomposition.regions) {
    for (const FeatureIdx feature : region.features) kept[feature] = 1;
  }
  return kept;
}

// Stations whose tau-neighbourhood lies in some region, as flags: the part of a region that is left after
// removing the stations with a neighbour outside, tau times.
std::vector<char> CoveredStations(const World& world, const Decomposition& decomposition) {
  const IndexLists neighbours = NeighbourLists(world);
  std::vector<char> covered(world.num_stations(), 0), is_inside(world.num_stations(), 0);
  for (const Region& region : decomposition.regions) {
    std::vector<StationIdx> inside = region.stations, outside;
    for (const StationIdx station : inside) is_inside[station] = 1;
    for (int hop = 0; hop < decomposition.tau; ++hop) {
      outside.clear();
      for (const StationIdx station : inside) {
        const auto next = neighbours[station];
        if (std::any_of(next.begin(), next.end(), [&](StationIdx other) { return !is_inside[other]; }))
          outside.push_back(station);
      }
      for (const StationIdx station : outside) is_inside[station] = 0;
      std::erase_if(inside, [&](StationIdx station) { return !is_inside[station]; });
    }
    for (const StationIdx station : inside) {
      covered[station] = 1;
      is_inside[station] = 0;
    }
  }
  return covered;
}

// Whether all stations of some region see the feature.
class CommonFeatures {
 public:
  CommonFeatures(const World& world, const Decomposition& decomposition)
      : decomposition_(decomposition),
        regions_of_(world.num_stations()),
        num_seeing_(decomposition.regions.size(), 0) {
    for (size_t region = 0; region < decomposition.regions.size(); ++region) {
      for (const StationIdx station : decomposition.regions[region].stations)
        regions_of_[station].push_back(static_cast<RegionIdx>(region));
    }
  }

  bool IsCommon(const std::vector<StationIdx>& area) {
    bool is_common = false;
    for (const StationIdx station : area) {
      for (const RegionIdx region : regions_of_[station]) {
        const size_t num_stations = decomposition_.regions[region].stations.size();
        is_common |= static_cast<size_t>(++num_seeing_[region]) == num_stations;
      }
    }
    for (const StationIdx station : area) {
      for (const RegionIdx region : regions_of_[station]) num_seeing_[region] = 0;
    }
    return is_common;
  }

 private:
  const Decomposition& decomposition_;
  std::vector<std::vector<RegionIdx>> regions_of_;
  std::vector<int32_t> num_seeing_;  // all 0 between calls
};

}  // namespace

std::vector<DroppedItem> ListDropped(const World& world, const Decomposition& decomposition) {
  std::vector<DroppedItem> items;
  const std::vector<char> kept = KeptFeatures(world, decomposition);
  CommonFeatures common(world, decomposition);
  std::vector<int64_t> num_visible(world.num_stations(), 0);
  for (FeatureIdx feature = 0; feature < world.num_features(); ++feature) {
    const std::vector<StationIdx>& area = world.areas[feature];
    for (const StationIdx station : area) ++num_visible[station];
    if (kept[feature]) continue;
    items.push_back({.reason = common.IsCommon(area) ? DropReason::kNotChosen : DropReason::kNotCommon,
                     .item_id = feature,
                     .found = static_cast<int64_t>(area.size())});
  }
  const std::vector<char> covered = CoveredStations(world, decomposition);
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (covered[station]) continue;
    const bool is_coverable =
        std::binary_search(decomposition.uncovered.begin(), decomposition.uncovered.end(), station);
    items.push_back({.reason = is_coverable                             ? DropReason::kLeftOver
                               : num_visible[station] < decomposition.k ? DropReason::kFewFeatures
                                                                        : DropReason::kFewCommonFeatures,
                     .item_id = station,
                     .found = num_visible[station]});
  }
  return items;
}

}  // namespace cairn::decompose_regions
