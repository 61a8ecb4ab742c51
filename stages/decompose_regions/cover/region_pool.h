#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "stages/decompose_regions/cover/cover.h"
#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {

// Candidate regions of a set cover problem, each station set once.
class RegionPool {
 public:
  // Stations with consecutive numbers, begin to end - 1.  A lattice that is numbered row by row has few of
  // them in a region, and the sum over a run is a difference of two partial sums.
  struct Run {
    StationIdx begin, end;
  };

  // False if the pool already has a region with these stations.
  bool Add(CoreRegion region);
  int size() const { return static_cast<int>(regions_.size()); }
  const CoreRegion& operator[](int region) const { return regions_[region]; }
  std::span<const Run> Runs(int region) const {
    return {runs_.data() + run_begins_[region], runs_.data() + run_begins_[region + 1]};
  }

 private:
  std::vector<CoreRegion> regions_;
  std::vector<Run> runs_;  // of all regions, one after the other
  std::vector<size_t> run_begins_ = {0};
  std::unordered_multimap<uint64_t, int32_t> by_hash_;
};

}  // namespace cairn::decompose_regions
