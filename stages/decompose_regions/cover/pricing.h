#pragma once

#include <cstdint>
#include <vector>

#include "stages/decompose_regions/cover/core_finder.h"

namespace cairn::decompose_regions {

// Values of stations as whole numbers, so that sums and bounds are exact.
using StationValues = std::vector<int64_t>;

// Finds regions of large value, the sum of the values of the stations that a region covers, quickly; the
// largest value takes exact_pricing.h.
class RegionPricer {
 public:
  explicit RegionPricer(const ReducedWorld& wide);

  // For each feature, the region that grows from it greedily: each next feature is the one that keeps most of
  // the value.  Appends the cores worth more than `threshold`.
  void Greedy(const StationValues& values, int64_t threshold, std::vector<CoreRegion>* found);

 private:
  // Sets live_areas_ and live_sets_ from the values.
  std::vector<int32_t> OrderFeatures(int64_t threshold);
  int64_t Value(const std::vector<StationIdx>& stations) const;

  const ReducedWorld& wide_;
  CoreFinder finder_;
  std::vector<int64_t> sums_;  // per feature, zero between uses
  std::vector<int32_t> touched_;

  // Of the search that is running.
  const StationValues* values_ = nullptr;
  IndexLists live_areas_, live_sets_;  // stations of value and features worth more than the threshold only
};

}  // namespace cairn::decompose_regions
