// [Sala06 Fig. 3] Algorithm A.1: regions grow from the station that sees the fewest features.
#include <algorithm>
#include <numeric>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {

void AlgorithmA1(uint64_t seed, Cover* cover) {
  const ReducedWorld& world = cover->world();
  const std::vector<int32_t> ranks = RandomRanks(world.num_stations(), seed);
  std::vector<StationIdx> order(world.num_stations());
  std::iota(order.begin(), order.end(), 0);
  // [Sala06 Fig. 3 line 3] v = argmin |F_v| over v in U, ties at random
  std::sort(order.begin(), order.end(), [&](StationIdx a, StationIdx b) {
    return std::pair(world.sets[a].size(), ranks[a]) < std::pair(world.sets[b].size(), ranks[b]);
  });
  GrowFromSeeds(order, seed, cover);
}

}  // namespace cairn::decompose_regions
