#pragma once

#include <cstdint>
#include <vector>

#include "core/base/random.h"
#include "stages/decompose_regions/cover/region_pool.h"

namespace cairn::decompose_regions {

// Searches for a cover of a given number of regions of a pool that leaves few stations uncovered, by
// simulated annealing [Kirkpatrick 1983]: the energy is the number of open stations that no chosen region
// contains, a move exchanges a chosen region for one that contains a station uncovered so far; moves that
// raise the energy by d are made with probability exp(-d / temperature), while the temperature falls.  A move
// costs O(stations of two regions).
class CoverAnnealing {
 public:
  // `pool` outlives this object and stays as it is.  `open`: per station, whether it is to be covered.
  CoverAnnealing(const RegionPool& pool, const std::vector<char>& open);

  // Starts from some regions and keeps their number.  Returns the first of the covers found with the fewest
  // uncovered stations.
  std::vector<int> Search(const std::vector<int>& start, int64_t num_exchanges, Random* random);

 private:
  void Start(const std::vector<int>& start);
  // The place of a chosen region that may be replaced by `other`.
  int PlaceToExchange(int other, Random* random) const;
  // Puts `other` in the place of a chosen region, or does nothing, by chance.
  void Exchange(int place, int other, double temperature, Random* random);

  const RegionPool& pool_;
  std::vector<StationIdx> open_stations_;
  std::vector<std::vector<int32_t>> regions_at_;  // per station

  std::vector<int> chosen_;
  std::vector<int> place_of_;          // per region, in chosen_; -1: not chosen
  std::vector<uint16_t> counts_;       // per station: chosen regions that contain it
  std::vector<StationIdx> uncovered_;  // open stations of count 0
  std::vector<int> uncovered_place_;   // per station, in uncovered_
};

}  // namespace cairn::decompose_regions
