// [Sala06 Fig. 3] Algorithm A.3: regions grow from random stations.
#include <algorithm>
#include <numeric>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {

void AlgorithmA3(uint64_t seed, Cover* cover) {
  // [Sala06 Fig. 3 line 3] v in U uniformly at random: the first open one of a random order
  std::vector<StationIdx> order = RandomRanks(cover->world().num_stations(), seed + 1);
  GrowFromSeeds(order, seed, cover);
}

}  // namespace cairn::decompose_regions
