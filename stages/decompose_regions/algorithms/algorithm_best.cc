#include "stages/decompose_regions/algorithms/algorithm_best.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "stages/decompose_regions/cover/column_generation.h"
#include "stages/decompose_regions/cover/core_finder.h"
#include "stages/decompose_regions/cover/cover_search.h"

namespace cairn::decompose_regions {
namespace {

// The pool starts with the regions of a decomposition.
void AddRegions(const Decomposition& decomposition, const ReducedWorld& wide, CoreFinder* finder,
                RegionPool* pool) {
  for (const Region& region : decomposition.regions) {
    std::vector<StationIdx> core = ShrinkStations(wide.neighbours, region.stations, decomposition.tau);
    std::erase_if(core, [&](StationIdx station) { return !wide.coverable[station]; });
    if (!core.empty()) pool->Add(finder->Widened(region.features, core));
  }
}

}  // namespace

Decomposition AlgorithmBest(const World& world, const Decomposition& start, const BestOptions& options,
                            uint64_t seed, Progress& progress) {
  const ReducedWorld wide = ReduceWorld(world, start.k, start.tau, seed, AreaSplit::kBeforeShrinking);
  const int max_uncovered = static_cast<int>(start.uncovered.size());
  CoreFinder finder(wide);
  ColumnGeneration generation(wide, max_uncovered, {});
  AddRegions(start, wide, &finder, &generation.pool());
  std::vector<int> cover(generation.pool().size());
  std::iota(cover.begin(), cover.end(), 0);
  progress.Begin("save regions", 1 + options.num_repairs, "steps");
  generation.Run();
  progress.Advance();
  // [Sala06 Def. 3.8] as few regions as can be found
  cover = SearchCover(
      &generation, wide, cover, seed,
      {.exchanges_per_station = options.exchanges_per_station, .num_repairs = options.num_repairs}, progress);
  progress.End();

  Decomposition fewest = start;
  fewest.regions.clear();
  fewest.uncovered.clear();
  std::vector<char> open = wide.coverable;
  for (const int idx : cover) {
    const CoreRegion& core = generation.pool()[idx];
    Region& region = fewest.regions.emplace_back();
    for (const int32_t feature : core.features) region.features.push_back(wide.original[feature]);
    std::sort(region.features.begin(), region.features.end());
    region.stations = finder.RegionOf(core, start.tau);
    for (const StationIdx station : core.stations) open[station] = 0;
  }
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (open[station]) fewest.uncovered.push_back(station);
  }
  fewest.uncovered_limit = static_cast<int>(fewest.uncovered.size());
  generation.LowerMaxUncovered(fewest.uncovered_limit);
  fewest.lower_bound = generation.lower_bound();
  return fewest;
}

int CertifiedLowerBound(const World& world, const Decomposition& decomposition) {
  const ReducedWorld wide =
      ReduceWorld(world, decomposition.k, decomposition.tau, decomposition.seed, AreaSplit::kBeforeShrinking);
  CoreFinder finder(wide);
  ColumnGeneration generation(wide, static_cast<int>(decomposition.uncovered.size()), {});
  AddRegions(decomposition, wide, &finder, &generation.pool());
  generation.Run();
  return generation.lower_bound();
}

}  // namespace cairn::decompose_regions
