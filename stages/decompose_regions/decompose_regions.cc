#include "stages/decompose_regions/decompose_regions.h"

#include <algorithm>

#include "stages/decompose_regions/algorithms/algorithm_best.h"
#include "stages/decompose_regions/algorithms/algorithms.h"
#include "stages/decompose_regions/cover/counting_bound.h"
#include "stages/decompose_regions/cover/cover.h"
#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {
namespace {

Error NothingCoverable(const World& world, const ReducedWorld& reduced,
                       const DecomposeRegionsOptions& options) {
  if (reduced.max_set_size == 0) {
    return MakeError(
        ErrorCode::kNoData,
        "no station is coverable: no feature is visible from all stations within tau = {} hops of any of "
        "the {} stations; choose a smaller tau or survey more densely",
        options.tau, world.num_stations());
  }
  const Eigen::Vector2d position = world.positions[reduced.max_set_station];
  return MakeError(ErrorCode::kNoData,
                   "no station is coverable: k = {} features must be visible within tau = {} hops, but the "
                   "best station ({} at {:.2f}, {:.2f}) has {}; choose k <= {}",
                   options.k, options.tau, reduced.max_set_station, position.x(), position.y(),
                   reduced.max_set_size, reduced.max_set_size);
}

int NumUncovered(const Cover& cover) {
  int num = 0;
  for (StationIdx station = 0; station < cover.world().num_stations(); ++station) {
    num += cover.world().coverable[station] && cover.NumRegionsAt(station) == 0;
  }
  return num;
}

void RunAlgorithm(const DecomposeRegionsOptions& options, uint64_t seed, Cover* cover) {
  if (options.algorithm == "a1") AlgorithmA1(seed, cover);
  if (options.algorithm == "a2") AlgorithmA2(seed, cover);
  if (options.algorithm == "a3") AlgorithmA3(seed, cover);
  if (options.algorithm == "b1") AlgorithmB1(cover);
  const bool is_b2 = options.algorithm == "b2" || options.algorithm == "best";
  if (is_b2) AlgorithmB2(cover);
  if (options.algorithm == "c") AlgorithmC(options.alpha, cover);
  bool added = options.max_hole >= 0 && cover->num_open() == 0 && LimitHoles(options.max_hole, cover);
  // `best` may leave as many stations uncovered as `start` does, anywhere: so allow no more in all than one
  // hole may have.
  if (options.algorithm == "best" && options.max_hole >= 0 && NumUncovered(*cover) > options.max_hole)
    added |= LimitHoles(0, cover);
  // [Sala06 §V-D] B.2 leaves no redundant region.
  if (!is_b2 || added) DropRedundantRegions(cover);
}

// [Sala06 Theorem 4.2] Grows the regions back and gives their features the world's numbers.
Region GrownRegion(const CoreRegion& core, const ReducedWorld& reduced, int tau) {
  Region region;
  for (const int32_t feature : core.features) region.features.push_back(reduced.original[feature]);
  std::sort(region.features.begin(), region.features.end());
  region.stations = GrowStations(reduced.neighbours, core.stations, tau);
  return region;
}

// A region grown by two or more hops can contain the whole neighbourhood of stations outside its core.  Takes
// the cores of the grown regions, and drops regions that have become redundant.
std::vector<CoreRegion> RegionsAfterGrowth(const Cover& cover, int tau) {
  const ReducedWorld& reduced = cover.world();
  std::vector<CoreRegion> kept;
  if (tau < 2) {
    for (const CoreRegion& region : cover.regions()) {
      if (!region.stations.empty()) kept.push_back(region);
    }
    return kept;
  }
  Cover closed(reduced, 0);
  std::vector<const CoreRegion*> cores;
  for (const CoreRegion& region : cover.regions()) {
    if (region.stations.empty()) continue;
    // [Sala06 Lemma 4.1] the stations whose neighbourhood lies in the grown region
    CoreRegion core{region.features, {}};
    for (const StationIdx station :
         ShrinkStations(reduced.neighbours, GrowStations(reduced.neighbours, region.stations, tau), tau)) {
      if (reduced.coverable[station]) core.stations.push_back(station);
    }
    if (closed.Add(core) > 0) cores.push_back(&region);
  }
  DropRedundantRegions(&closed);
  for (size_t i = 0; i < cores.size(); ++i) {
    if (!closed.IsDropped(static_cast<int>(i))) kept.push_back(*cores[i]);
  }
  return kept;
}

}  // namespace

OptionTable DescribeOptions(DecomposeRegionsOptions* o) {
  OptionTable table = {
      {.name = "algorithm",
       .value = &o->algorithm,
       .help = "best: fewest regions, by column generation from b2's; or an algorithm of Sala06 §V",
       .choices = {"a1", "a2", "a3", "b1", "b2", "c", "best"}},
      {.name = "k",
       .value = &o->k,
       .help = "number of features visible everywhere in a region (Sala06: 4, 10)",
       .min = 1},
      {.name = "tau",
       .value = &o->tau,
       .help = "every station's neighbourhood of this many hops lies in some region (Sala06: 0, 1)",
       .min = 0},
      {.name = "rho",
       .value = &o->rho,
       .help = "a region must cover more than this many stations that nothing else covers (Sala06: 9, 3)",
       .min = 0},
      {.name = "max_hole",
       .value = &o->max_hole,
       .help = "most connected coverable stations that may be in no region; -1: whatever rho leaves",
       .min = -1},
      {.name = "alpha",
       .value = &o->alpha,
       .help = "algorithm c: least share of a disc's stations that are open (Sala06: 0.85)",
       .min = 0,
       .max = 1},
      {.name = "lower_bound",
       .value = &o->lower_bound,
       .help = "certified least number of regions: certified (column generation, seconds), counted (weaker, "
               "cheap), none; auto: certified with algorithm best, else counted",
       .choices = {"auto", "certified", "counted", "none"}},
      {.name = "best_exchanges_per_station",
       .value = &o->best_exchanges_per_station,
       .help = "algorithm best: exchanges of regions, per station, that leave fewer stations uncovered",
       .min = 0},
      {.name = "best_num_repairs",
       .value = &o->best_num_repairs,
       .help =
           "algorithm best: number of neighbourhoods that are covered again, in each part of the world or "
           "window; time grows with it",
       .min = 0},
      {.name = "best_window_stations",
       .value = &o->best_window_stations,
       .help = "algorithm best: number of stations that are covered at once, or what 120 regions cover if "
               "that is more; a larger part of a world is covered window by window",
       .min = 1},
      {.name = "best_max_stations",
       .value = &o->best_max_stations,
       .help = "largest world for column generation; beyond it, best is b2 and the bound is counted",
       .min = 0},
  };
  const OptionTable choose_features = DescribeOptions(&o->choose_features);
  table.insert(table.end(), choose_features.begin(), choose_features.end());
  AddCondition({"algorithm", {"c"}}, {"alpha"}, &table);
  AddCondition({"algorithm", {"best"}},
               {"best_exchanges_per_station", "best_num_repairs", "best_window_stations"}, &table);
  return table;
}

Result<Decomposition> DecomposeRegions(const World& world, const DecomposeRegionsOptions& options,
                                       uint64_t seed) {
  NoProgress progress;
  return DecomposeRegions(world, options, seed, 1, progress);
}

Result<Decomposition> DecomposeRegions(const World& world, const DecomposeRegionsOptions& options,
                                       uint64_t seed, int num_threads, Progress& progress) {
  DecomposeRegionsOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (world.num_stations() == 0) return MakeError(ErrorCode::kNoData, "the world has no station");
  const ReducedWorld reduced = ReduceWorld(world, options.k, options.tau, seed);
  if (reduced.num_coverable == 0) return NothingCoverable(world, reduced, options);

  progress.Begin("decompose regions", reduced.num_coverable, "stations");
  Cover cover(reduced, options.rho, &progress);
  RunAlgorithm(options, seed, &cover);
  progress.End();
  if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while decomposing regions");

  Decomposition decomposition{
      .algorithm = options.algorithm, .k = options.k, .tau = options.tau, .rho = options.rho, .seed = seed};
  std::vector<char> covered(world.num_stations(), 0);
  for (const CoreRegion& core : RegionsAfterGrowth(cover, options.tau)) {
    Region region = GrownRegion(core, reduced, options.tau);
    const std::vector<StationIdx> inner =
        options.tau < 2 ? core.stations : ShrinkStations(reduced.neighbours, region.stations, options.tau);
    for (const StationIdx station : inner) covered[station] = 1;
    decomposition.regions.push_back(std::move(region));
  }
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (reduced.coverable[station] && !covered[station]) decomposition.uncovered.push_back(station);
  }
  decomposition.uncovered_limit = static_cast<int>(decomposition.uncovered.size());

  if (decomposition.regions.empty()) {
    return MakeError(ErrorCode::kNoData,
                     "no region covers more than rho = {} of the {} coverable stations; choose a smaller rho",
                     options.rho, reduced.num_coverable);
  }
  const bool is_small = world.num_stations() <= options.best_max_stations;
  if (options.algorithm == "best" && is_small) {
    decomposition =
        AlgorithmBest(world, decomposition,
                      {.exchanges_per_station = options.best_exchanges_per_station,
                       .num_repairs = options.best_num_repairs,
                       .window_stations = options.best_window_stations,
                       .with_bound = options.lower_bound == "auto" || options.lower_bound == "certified",
                       .num_threads = num_threads},
                      seed, progress);
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while decomposing regions");
    if (options.lower_bound == "counted")
      decomposition.lower_bound = CountingBound(reduced, decomposition.uncovered_limit);
  } else if (options.lower_bound == "certified" && is_small) {
    decomposition.lower_bound = CertifiedLowerBound(world, decomposition, num_threads, progress);
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "stopped while decomposing regions");
  } else if (options.lower_bound != "none") {
    decomposition.lower_bound = CountingBound(reduced, decomposition.uncovered_limit);
  }
  if (options.lower_bound == "none") decomposition.lower_bound.reset();
  return decomposition;
}

std::vector<StationIdx> CoverableStations(const World& world, int k, int tau) {
  const ReducedWorld reduced = ReduceWorld(world, k, tau, 0);
  std::vector<StationIdx> stations;
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (reduced.coverable[station]) stations.push_back(station);
  }
  return stations;
}

}  // namespace cairn::decompose_regions
