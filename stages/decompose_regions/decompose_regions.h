#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/options/options.h"
#include "core/world/decomposition.h"
#include "core/world/world.h"
#include "stages/decompose_regions/choose_features.h"

namespace cairn::decompose_regions {

// Divides a world into few large regions of stations, so that the same k features are visible everywhere in a
// region: these are the landmarks that a robot needs there.  Before: filter_visibility.  After: emit_map.
// Implements [Sala06 §III, §IV, §V].  The problem, tau-MORDP [Sala06 Def. 3.8]: the smallest set D of regions
// R, each connected, with
//   |intersection of F_v over v in R| >= k           for every R in D, and
//   N_tau(v) inside of some R in D                   for every station v
// where N_tau(v) are the stations within tau hops of v.  NP-complete; the algorithms are approximations.
// Differs from the source: ties are broken by a seed everywhere; features and regions whose stations are not
// connected are split into their components; stations of a rejected region leave U.
//
// | paper | here                                                                                        |
// | F_v   | a station's features, ReducedWorld::sets                                                    |
// | U     | open stations: not yet assigned to a region, Cover::IsOpen                                  |
// | D     | Cover::regions                                                                              |
// | L     | CoreRegion::features                                                                        |
// | rho   | a region must cover more than rho stations that nothing else covers                         |
struct DecomposeRegionsOptions {
  // "a1", "a2", "a3", "b1", "b2" or "c" [Sala06 §V-B, §V-C], or "best" (algorithm_best.h).
  std::string algorithm = "best";
  // Number of features that are visible everywhere in a region [Sala06: 4 and 10; here more, so that a
  // query may miss some].  REQUIRES: >= 1
  int k = 40;
  // Overlap: the tau-neighbourhood of every station lies in some region, hops [Sala06: 0 and 1].
  // REQUIRES: >= 0
  int tau = 1;
  // A region is kept only if it covers more than this many stations that nothing else covers [Sala06: 9 in
  // simulated worlds, 3 in the real one].  REQUIRES: >= 0
  int rho = 0;
  // Largest number of connected coverable stations that may be in no region; -1: whatever rho leaves.
  // Remainders that rho drops one by one can add up to larger holes, which then get regions.  REQUIRES: >= -1
  int max_hole = -1;
  // Algorithm C: least share of a disc's stations that are open [Sala06: 0.85].  REQUIRES: in [0, 1]
  double alpha = 0.85;
  // Certified least number of regions: "certified" (column_generation.h), "counted" (counting_bound.h;
  // weaker, cheap), "none", or "auto": certified with algorithm "best", else counted.
  std::string lower_bound = "auto";
  // Algorithm best: exchanges of a region for another, per coverable station, so that fewer stations are
  // uncovered (cover_annealing.h).  REQUIRES: >= 0
  int best_exchanges_per_station = 400;
  // Algorithm best: number of neighbourhoods that are covered again, in each part of the world or window
  // (cover_search.h).  REQUIRES: >= 0
  int best_num_repairs = 60;
  // Algorithm best: coverable stations that are covered at once, or what 120 regions cover if that is more;
  // larger parts of a world are covered window by window (algorithm_best.h).  REQUIRES: >= 1
  int best_window_stations = 1500;
  // Column generation takes two minutes for 60,000 stations: worlds larger than this get the regions of B.2
  // instead of best's, and the counted bound.  REQUIRES: >= 0
  int best_max_stations = 200000;
  // Which features regions keep: used by ChooseFeatures after the regions are made, where the classes
  // are known.
  ChooseFeaturesOptions choose_features;
};
OptionTable DescribeOptions(DecomposeRegionsOptions* options);

// Pure: same world, options and seed, same result.  B.2 costs O(incidences) per reading of the world plus,
// for each region, O(k) passes over the incidences of the region's stations; memory is proportional to the
// incidences.  REQUIRES: CheckWorld(world) is ok.  Errors: InvalidArgument for a bad option, NoData when no
// station is coverable (says which k the best station allows) or no region covers more than rho, Cancelled.
// `num_threads` changes nothing.
Result<Decomposition> DecomposeRegions(const World& world, const DecomposeRegionsOptions& options,
                                       uint64_t seed, int num_threads, Progress& progress);
Result<Decomposition> DecomposeRegions(const World& world, const DecomposeRegionsOptions& options,
                                       uint64_t seed);

// Stations that a decomposition has to cover [Sala06 §V-A]: at least k features are visible from all of
// N_tau(v).  Ascending.
std::vector<StationIdx> CoverableStations(const World& world, int k, int tau);

}  // namespace cairn::decompose_regions
