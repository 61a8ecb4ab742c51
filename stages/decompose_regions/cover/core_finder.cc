#include "stages/decompose_regions/cover/core_finder.h"

#include <algorithm>
#include <iterator>

namespace cairn::decompose_regions {

CoreFinder::CoreFinder(const ReducedWorld& wide) : wide_(wide), finder_(wide.neighbours) {}

std::vector<std::vector<StationIdx>> CoreFinder::Cores(std::span<const int32_t> features) {
  std::vector<StationIdx> stations = CommonStations(wide_.areas, features);
  std::vector<std::vector<StationIdx>> cores;
  if (finder_.Components(stations).size() < 2) {  // paths inside of X are paths inside of Q
    if (!stations.empty()) cores.push_back(std::move(stations));
    return cores;
  }
  for (const std::vector<StationIdx>& region :
       finder_.Components(CommonStations(wide_.whole_areas, features))) {
    std::vector<StationIdx> core;
    std::set_intersection(stations.begin(), stations.end(), region.begin(), region.end(),
                          std::back_inserter(core));
    if (!core.empty()) cores.push_back(std::move(core));
  }
  return cores;
}

CoreRegion CoreFinder::Widened(const std::vector<FeatureIdx>& world_features,
                               const std::vector<StationIdx>& stations) {
  CoreRegion widened;
  for (const int32_t feature : wide_.sets[stations[0]]) {
    const FeatureIdx original = wide_.original[feature];
    if (std::find(world_features.begin(), world_features.end(), original) != world_features.end()) {
      widened.features.push_back(feature);
    }
  }
  for (std::vector<StationIdx>& core : Cores(widened.features)) {
    if (std::binary_search(core.begin(), core.end(), stations[0])) widened.stations = std::move(core);
  }
  return widened;
}

std::vector<StationIdx> CoreFinder::RegionOf(const CoreRegion& core, int tau) {
  std::vector<StationIdx> grown = GrowStations(wide_.neighbours, core.stations, tau);
  if (finder_.Components(grown).size() == 1) return grown;
  for (std::vector<StationIdx>& region :
       finder_.Components(CommonStations(wide_.whole_areas, core.features))) {
    if (std::binary_search(region.begin(), region.end(), core.stations[0])) return std::move(region);
  }
  return grown;  // not reached: a core lies in one of them
}

}  // namespace cairn::decompose_regions
