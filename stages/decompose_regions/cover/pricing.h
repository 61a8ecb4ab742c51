#pragma once

#include <cstdint>
#include <vector>

#include "stages/decompose_regions/cover/core_finder.h"

namespace cairn::decompose_regions {

// Values of stations as whole numbers, so that sums and bounds are exact.
using StationValues = std::vector<int64_t>;

// Searches regions for a large value: the sum of the values of the stations that a region covers.
class RegionPricer {
 public:
  explicit RegionPricer(const ReducedWorld& wide);

  // For each feature, the region that grows from it greedily: each next feature is the one that keeps most of
  // the value.  Appends the cores worth more than `threshold`.
  void Greedy(const StationValues& values, int64_t threshold, std::vector<CoreRegion>* found);

  // An upper bound of the value of every region of the world with k common features (CoreFinder): at least
  // `threshold`, and equal to the largest value if that is more and the search was complete.  Branch and
  // bound over sets of features: a set's value is at most that of each of its subsets, and a set grows only
  // by features that keep more than the threshold.  After `max_work` incidences have been read, each feature
  // left is bounded by its (k - 1)-th best partner.  Appends up to `max_found` cores worth more than
  // the threshold.
  int64_t MaxValue(const StationValues& values, int64_t threshold, int64_t max_work, size_t max_found,
                   std::vector<CoreRegion>* found);

 private:
  struct Candidate {
    int32_t feature;
    int64_t value;  // of the stations that see it and all features chosen so far
  };

  // Sets live_areas_, live_sets_ and rank_ from the values.
  std::vector<int32_t> OrderFeatures(int64_t threshold);
  std::vector<Candidate> Candidates(const std::vector<StationIdx>& stations, int32_t rank);
  void Search(const std::vector<StationIdx>& stations, const std::vector<Candidate>& candidates);
  void CloseLeaf(std::vector<int32_t> features);
  int64_t Value(const std::vector<StationIdx>& stations) const;

  const ReducedWorld& wide_;
  CoreFinder finder_;
  std::vector<int64_t> sums_;  // per feature, zero between uses
  std::vector<int32_t> touched_;

  // Of the search that is running.
  const StationValues* values_ = nullptr;
  IndexLists live_areas_, live_sets_;  // stations of value and features worth more than the threshold only
  std::vector<int32_t> rank_;          // per feature: its place in the order of the search
  int64_t threshold_ = 0, max_value_ = 0, work_left_ = 0;
  size_t max_found_ = 0;
  std::vector<int32_t> chosen_;
  std::vector<CoreRegion>* found_ = nullptr;
};

}  // namespace cairn::decompose_regions
