#pragma once

#include <cstdint>

#include "core/base/progress.h"
#include "core/world/decomposition.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

// Effort of `best`; counts, not times, so that the result does not depend on the machine.
struct BestOptions {
  // Exchanges of a region for another, per coverable station, while annealing (cover_annealing.h).
  // REQUIRES: >= 0
  int exchanges_per_station = 400;
  // Neighbourhoods that are covered again, in each part or window (cover_search.h).  REQUIRES: >= 0
  int num_repairs = 60;
  // Coverable stations that are covered at once.  REQUIRES: >= 1
  int window_stations = 1500;
  // Or as many as so many regions cover on average, if that is more.  REQUIRES: >= 0
  int window_regions = 120;
  // Whether a lower bound is wanted; without one it is 0.
  bool with_bound = true;
  // The result does not depend on it.
  int num_threads = 1;
};

// Finds fewer regions: replaces those of `start` by at most as many, which leave at most as many coverable
// stations uncovered, and states a certified lower bound (column_generation.h).  Not in [Sala06], whose §VII
// asks for it.  Column generation on the linear program of set cover finds regions worth having and the
// bound; dives and simulated annealing choose among them (cover_search.h).
//
// Parts between which no region passes are covered each by itself.  A part with more stations than a window
// may have is divided into windows, in each of which the regions that lie in it are replaced, the others
// being left as they are; and this three times, each time with other borders.  Its bound is that of the
// linear program of the whole part.  So time grows with the stations, times the regions that meet at one.
//
// Pure; when cancelled it returns the best result so far.  REQUIRES: `start` is a decomposition of the world;
// CheckWorld(world) is ok.
Decomposition AlgorithmBest(const World& world, const Decomposition& start, const BestOptions& options,
                            uint64_t seed, Progress& progress);

// The lower bound alone, for a decomposition made by any algorithm.
int CertifiedLowerBound(const World& world, const Decomposition& decomposition, int num_threads,
                        const Progress& progress);

}  // namespace cairn::decompose_regions
