#include "stages/decompose_regions/cover/region_pool.h"

#include <utility>

#include "core/base/random.h"

namespace cairn::decompose_regions {

bool RegionPool::Add(CoreRegion region) {
  uint64_t hash = 0;
  for (const StationIdx station : region.stations) hash = MixSeed(hash, static_cast<uint64_t>(station));
  const auto [begin, end] = by_hash_.equal_range(hash);
  for (auto entry = begin; entry != end; ++entry) {
    if (regions_[entry->second].stations == region.stations) return false;
  }
  by_hash_.emplace(hash, size());
  for (size_t i = 0; i < region.stations.size(); ++i) {
    const StationIdx station = region.stations[i];
    if (i == 0 || region.stations[i - 1] != station - 1) runs_.push_back({station, station});
    runs_.back().end = station + 1;
  }
  run_begins_.push_back(runs_.size());
  regions_.push_back(std::move(region));
  return true;
}

}  // namespace cairn::decompose_regions
