#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/progress.h"
#include "stages/decompose_regions/cover/column_generation.h"

namespace cairn::decompose_regions {

// Effort of the search; counts, so that the result does not depend on the machine.
struct CoverSearchOptions {
  int num_lp_iterations = 60;       // between two fixings
  int exchanges_per_station = 400;  // of regions, per coverable station, while annealing
  int num_repairs = 60;             // neighbourhoods that are opened and covered again
};

// Drops the core that covers the fewest stations alone, the first of such, repeatedly, as long as no more
// than `max_lost` stations are in none for it; below 0: none.  Returns, per core, whether it is kept.
std::vector<char> KeepMostUseful(const std::vector<std::span<const StationIdx>>& cores, int num_stations,
                                 int max_lost);

// Few regions that cover all but H coverable stations, near the optimum of the linear relaxation: dives
// (fixes the regions of largest x, solves again, adds regions that are worthwhile for the rest, and so on),
// then opens the neighbourhood of one station after the other and dives there, keeping the regions elsewhere;
// a cover with fewer regions, or as many and fewer uncovered stations, is accepted.  Last it anneals the
// cover so that few stations are uncovered (cover_annealing.h).  `start`: pool indices of regions that cover
// enough.  Returns pool indices, ascending; never more than `start`.
std::vector<int> SearchCover(ColumnGeneration* generation, const ReducedWorld& wide, std::vector<int> start,
                             uint64_t seed, const CoverSearchOptions& options, Progress& progress);

}  // namespace cairn::decompose_regions
