#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "stages/decompose_regions/cover.h"
#include "stages/decompose_regions/reduced_world.h"

namespace cairn {

// Candidate regions of a set cover problem, each station set once.
class RegionPool {
 public:
  explicit RegionPool(int num_stations) : regions_at_(num_stations) {}

  // False if a region with these stations is there already.
  bool Add(CoreRegion region);
  int size() const { return static_cast<int>(regions_.size()); }
  const CoreRegion& operator[](int region) const { return regions_[region]; }
  // Regions that contain a station, ascending.
  const std::vector<int32_t>& At(StationIdx station) const { return regions_at_[station]; }
  int num_stations() const { return static_cast<int>(regions_at_.size()); }

 private:
  std::vector<CoreRegion> regions_;
  std::vector<std::vector<int32_t>> regions_at_;
  std::unordered_multimap<uint64_t, int32_t> by_hash_;
};

}  // namespace cairn
