// Fewest regions and certified bounds: `best` against B.2 on the same random worlds of the four settings.
//
//   regions_best --worlds 50
//
// Worlds are seeds 0, 1, ... of simulate-worlds with its default densities.
#include <algorithm>
#include <ctime>
#include <iostream>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "sim/worlds/simulate_worlds.h"
#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/decompose_regions.h"

namespace cairn {
namespace {

struct Sums {
  int num_worlds = 0;
  double b2_regions = 0, best_regions = 0, lower_bound = 0, counted_bound = 0;
  double b2_uncovered = 0, best_uncovered = 0, b2_hole = 0, best_hole = 0;
  double fewer_ratio = 0, gap_ratio = 0, seconds = 0, max_seconds = 0;
};

// Both algorithms on one world.  False if the world cannot be made, or a result breaks a property
// (says which).
bool Add(int setting, uint64_t seed, decompose_regions::DecomposeRegionsOptions options, Sums* sums) {
  const Result<World> world = sim::SimulateWorld({.setting = setting}, seed);
  if (!world.ok()) return false;
  options.algorithm = "b2";
  const Result<Decomposition> b2 = decompose_regions::DecomposeRegions(*world, options, seed);
  options.algorithm = "best";
  const std::clock_t start = std::clock();
  const Result<Decomposition> best = decompose_regions::DecomposeRegions(*world, options, seed);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  if (!b2.ok() || !best.ok()) return false;
  const decompose_regions::RegionCheck check = decompose_regions::CheckRegions(*world, *best),
                                       b2_check = decompose_regions::CheckRegions(*world, *b2);
  for (const std::string& violation : check.violations)
    std::cerr << "seed " << seed << ": " << violation << "\n";
  if (!check.violations.empty()) return false;
  const auto num_b2 = static_cast<double>(b2->regions.size()),
             num_best = static_cast<double>(best->regions.size());
  const double bound = std::max(1, best->lower_bound.value_or(0));
  ++sums->num_worlds;
  sums->b2_regions += num_b2;
  sums->best_regions += num_best;
  sums->lower_bound += bound;
  sums->counted_bound += b2->lower_bound.value_or(0);
  sums->b2_uncovered += b2_check.num_uncovered;
  sums->best_uncovered += check.num_uncovered;
  sums->b2_hole += b2_check.largest_hole;
  sums->best_hole += check.largest_hole;
  sums->fewer_ratio += 1 - num_best / num_b2;
  sums->gap_ratio += num_best / bound - 1;
  sums->seconds += seconds;
  sums->max_seconds = std::max(sums->max_seconds, seconds);
  return true;
}

void Print(int setting, const Sums& sums) {
  const double n = std::max(1, sums.num_worlds);
  fmt::print(
      "| {} | {} | {:.1f} | {:.1f} | {:.1f} % | {:.1f} | {:.1f} | {:.1f} % | {:.0f} / {:.0f} | {:.0f} / "
      "{:.0f} | {:.1f} ({:.1f}) |\n",
      setting, sums.num_worlds, sums.b2_regions / n, sums.best_regions / n, 100 * sums.fewer_ratio / n,
      sums.lower_bound / n, sums.counted_bound / n, 100 * sums.gap_ratio / n, sums.b2_uncovered / n,
      sums.best_uncovered / n, sums.b2_hole / n, sums.best_hole / n, sums.seconds / n, sums.max_seconds);
  std::fflush(stdout);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app("Algorithm best against B.2: number of regions, certified gap, processor seconds");
  int num_worlds = 50;
  std::vector<int> settings = {1, 2, 3, 4};
  uint64_t seed = 0;
  cairn::decompose_regions::DecomposeRegionsOptions options{.k = 4, .tau = 1, .rho = 9};
  app.add_option("--worlds", num_worlds, "worlds per setting")->capture_default_str();
  app.add_option("--settings", settings, "settings to run")->delimiter(',')->capture_default_str();
  app.add_option("--seed", seed, "seed of the first world")->capture_default_str();
  app.add_option("--k", options.k)->capture_default_str();
  app.add_option("--tau", options.tau)->capture_default_str();
  app.add_option("--rho", options.rho)->capture_default_str();
  app.add_option("--best-exchanges-per-station", options.best_exchanges_per_station)->capture_default_str();
  app.add_option("--best-num-repairs", options.best_num_repairs)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| setting | worlds | B.2 | best | fewer | at least (certified) | B.2's counted bound | gap of best | "
      "uncovered B.2 / best | largest hole B.2 / best | s a world (slowest) |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const int setting : settings) {
    cairn::Sums sums;
    for (int i = 0; i < num_worlds; ++i) {
      if (!cairn::Add(setting, seed + static_cast<uint64_t>(i), options, &sums)) {
        fmt::print(stderr, "setting {}, seed {}: left out\n", setting, seed + static_cast<uint64_t>(i));
      }
    }
    cairn::Print(setting, sums);
  }
  return 0;
}
