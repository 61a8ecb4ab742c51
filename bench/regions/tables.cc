// [Sala06 Table II, Table III] The six algorithms on random worlds of the four settings, beside the
// source's figures.
//
//   regions_tables --worlds 300
//
// Worlds are seeds 0, 1, ... of simulate-worlds with its default densities.
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "core/base/parallel.h"
#include "core/files/file.h"
#include "sim/worlds/simulate_worlds.h"
#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/cover/reduced_world.h"
#include "stages/decompose_regions/decompose_regions.h"

namespace cairn {
namespace {

constexpr std::array kAlgorithms = {"a1", "a2", "a3", "b1", "b2", "c"};
// The source's, by setting and algorithm.
constexpr double kSourceRegions[4][6] = {{173.81, 156.96, 154.97, 127.76, 112.63, 140.10},
                                         {59.30, 56.45, 54.72, 44.74, 42.10, 44.17},
                                         {112.40, 100.46, 98.97, 82.11, 73.08, 82.29},
                                         {44.71, 40.00, 39.11, 31.99, 30.02, 31.11}};
constexpr double kSourcePoses[4][6] = {{70.76, 76.49, 75.74, 80.60, 80.99, 71.85},
                                       {253.88, 276.37, 272.83, 281.63, 279.81, 251.86},
                                       {69.04, 74.60, 73.95, 78.63, 79.29, 71.61},
                                       {215.15, 237.68, 234.67, 244.44, 241.26, 218.56}};

struct Means {
  double num_regions = 0;
  double grown_poses = 0, core_poses = 0;  // per region, of the tau-grown regions and before growing
  double num_landmarks = 0;                // union of the regions' features
  double num_uncovered = 0;
  double largest_hole = 0;
  double milliseconds = 0;
};

struct WorldRow {
  uint64_t seed = 0;
  double num_stations = 0, num_visible = 0, num_coverable = 0;
  std::array<Means, kAlgorithms.size()> means;
};

Means Measure(const World& world, const decompose_regions::IndexLists& neighbours,
              const decompose_regions::DecomposeRegionsOptions& options, uint64_t seed) {
  const auto start = std::chrono::steady_clock::now();
  const Result<Decomposition> result = decompose_regions::DecomposeRegions(world, options, seed);
  const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - start;
  Means means{.milliseconds = elapsed.count()};
  if (!result.ok()) return means;
  std::set<FeatureIdx> landmarks;
  for (const Region& region : result->regions) {
    landmarks.insert(region.features.begin(), region.features.end());
    means.grown_poses +=
        static_cast<double>(region.stations.size()) / static_cast<double>(result->regions.size());
    means.core_poses +=
        static_cast<double>(
            decompose_regions::ShrinkStations(neighbours, region.stations, options.tau).size()) /
        static_cast<double>(result->regions.size());
  }
  means.num_regions = static_cast<double>(result->regions.size());
  means.num_landmarks = static_cast<double>(landmarks.size());
  means.num_uncovered = static_cast<double>(result->uncovered.size());
  means.largest_hole = decompose_regions::CheckRegions(world, *result).largest_hole;
  return means;
}

WorldRow RunWorld(const sim::SimulateWorldsOptions& simulation,
                  decompose_regions::DecomposeRegionsOptions options, uint64_t seed) {
  WorldRow row{.seed = seed};
  const Result<World> world = sim::SimulateWorld(simulation, seed);
  if (!world.ok()) return row;
  const decompose_regions::IndexLists neighbours = decompose_regions::NeighbourLists(*world);
  row.num_stations = world->num_stations();
  row.num_visible = static_cast<double>(world->num_incidences()) / world->num_stations();
  row.num_coverable =
      static_cast<double>(decompose_regions::CoverableStations(*world, options.k, options.tau).size());
  for (size_t a = 0; a < kAlgorithms.size(); ++a) {
    options.algorithm = kAlgorithms[a];
    row.means[a] = Measure(*world, neighbours, options, seed);
  }
  return row;
}

double Mean(const std::vector<WorldRow>& rows, const auto& value) {
  double sum = 0;
  for (const WorldRow& row : rows) sum += value(row);
  return sum / static_cast<double>(rows.size());
}

// Standard error of the mean over the worlds of (a - b), the difference of two algorithms' region counts.
double ErrorOfDifference(const std::vector<WorldRow>& rows, size_t a, size_t b) {
  const auto difference = [&](const WorldRow& r) { return r.means[a].num_regions - r.means[b].num_regions; };
  const double mean = Mean(rows, difference);
  const double variance = Mean(rows, [&](const WorldRow& r) { return std::pow(difference(r) - mean, 2); });
  return std::sqrt(variance / static_cast<double>(rows.size()));
}

// A line for each world and algorithm, for programs.
constexpr char kCsvHead[] =
    "setting,seed,algorithm,stations,coverable,visible,regions,stations_a_region,grown,landmarks,uncovered,"
    "largest_hole,milliseconds,source_regions,source_stations_a_region\n";
std::string CsvLines(int setting, const std::vector<WorldRow>& rows) {
  std::string csv;
  for (const WorldRow& row : rows) {
    for (size_t a = 0; a < kAlgorithms.size(); ++a) {
      const Means& m = row.means[a];
      csv += fmt::format("{},{},{},{},{},{:.3f},{},{:.3f},{:.3f},{},{},{},{:.1f},{},{}\n", setting, row.seed,
                         kAlgorithms[a], row.num_stations, row.num_coverable, row.num_visible, m.num_regions,
                         m.core_poses, m.grown_poses, m.num_landmarks, m.num_uncovered, m.largest_hole,
                         m.milliseconds, kSourceRegions[setting - 1][a], kSourcePoses[setting - 1][a]);
    }
  }
  return csv;
}

// Worlds that are done, on stderr: a line for each tenth.
class WorldCounter {
 public:
  WorldCounter(int setting, int num_worlds) : setting_(setting), num_worlds_(num_worlds) {}
  void Advance() {
    const int done = ++num_done_;
    if (10 * done / num_worlds_ != 10 * (done - 1) / num_worlds_)
      fmt::print(stderr, "setting {}: {} of {} worlds\n", setting_, done, num_worlds_);
  }

 private:
  const int setting_, num_worlds_;
  std::atomic<int> num_done_ = 0;
};

void Print(int setting, const std::vector<WorldRow>& rows) {
  fmt::print(
      "\nsetting {}: {} worlds, mean {:.0f} stations ({:.0f} coverable), {:.1f} features visible from one\n",
      setting, rows.size(), Mean(rows, [](const WorldRow& r) { return r.num_stations; }),
      Mean(rows, [](const WorldRow& r) { return r.num_coverable; }),
      Mean(rows, [](const WorldRow& r) { return r.num_visible; }));
  fmt::print("{:<34}", "");
  for (const char* algorithm : kAlgorithms) fmt::print("{:>9}", algorithm);
  const auto line = [&](const char* name, const auto& value) {
    fmt::print("\n{:<34}", name);
    for (size_t a = 0; a < kAlgorithms.size(); ++a) fmt::print("{:>9.2f}", value(a));
  };
  const auto mean = [&](double Means::*member) {
    return [&rows, member](size_t a) {
      return Mean(rows, [&](const WorldRow& r) { return r.means[a].*member; });
    };
  };
  const auto num_regions = mean(&Means::num_regions);
  line("regions", num_regions);
  // [Sala06 Table II, Table III]
  line("  source (Table II)", [&](size_t a) { return kSourceRegions[setting - 1][a]; });
  line("  over B.2", [&](size_t a) { return num_regions(a) / num_regions(4); });
  line("  over B.2, source",
       [&](size_t a) { return kSourceRegions[setting - 1][a] / kSourceRegions[setting - 1][4]; });
  line("stations per region, not grown", mean(&Means::core_poses));
  line("stations per region, grown", mean(&Means::grown_poses));
  line("  source (Table III)", [&](size_t a) { return kSourcePoses[setting - 1][a]; });
  line("landmarks (union)", mean(&Means::num_landmarks));
  line("uncovered stations", mean(&Means::num_uncovered));
  line("largest connected hole", mean(&Means::largest_hole));
  line("milliseconds", mean(&Means::milliseconds));
  fmt::print("\na2 - a3: {:.2f} +- {:.2f} regions; c - b1: {:.2f} +- {:.2f}\n",
             num_regions(1) - num_regions(2), ErrorOfDifference(rows, 1, 2), num_regions(5) - num_regions(3),
             ErrorOfDifference(rows, 5, 3));
  std::fflush(stdout);
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app("Tables II and III of Sala06, regenerated beside the source's figures");
  int num_worlds = 300, num_threads = 0;
  std::vector<int> settings = {1, 2, 3, 4};
  uint64_t seed = 0;
  cairn::decompose_regions::DecomposeRegionsOptions options{.k = 4, .tau = 1, .rho = 9};  // [Sala06 §VI-A]
  cairn::sim::SimulateWorldsOptions simulation;
  app.add_option("--worlds", num_worlds, "worlds per setting")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--settings", settings, "settings to run")
      ->delimiter(',')
      ->check(CLI::Range(1, 4))
      ->capture_default_str();
  app.add_option("--seed", seed, "seed of the first world")->capture_default_str();
  app.add_option("--threads", num_threads, "0: all cores")->capture_default_str();
  for (auto [name, value] :
       {std::pair("--k", &options.k), {"--tau", &options.tau}, {"--rho", &options.rho}}) {
    app.add_option(name, *value)->capture_default_str();
  }
  for (auto [name, value] : {std::pair("--radius-m", &simulation.radius_m),
                             {"--min-obstacle-radius-m", &simulation.min_obstacle_radius_m},
                             {"--max-obstacle-radius-m", &simulation.max_obstacle_radius_m},
                             {"--area-scale", &simulation.area_scale}}) {
    app.add_option(name, *value)->capture_default_str();
  }
  std::string csv_path, csv = cairn::kCsvHead;
  app.add_option("--csv", csv_path, "File for a line of each world and algorithm");
  app.add_option("--num-features", simulation.num_features, "0: the setting's")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  fmt::print("k = {}, tau = {}, rho = {}, alpha = {}\n", options.k, options.tau, options.rho, options.alpha);
  for (const int setting : settings) {
    simulation.setting = setting;
    std::vector<cairn::WorldRow> rows(num_worlds);
    cairn::WorldCounter counter(setting, num_worlds);
    cairn::ParallelFor(num_worlds, num_threads, [&](int64_t i) {
      rows[i] = cairn::RunWorld(simulation, options, seed + static_cast<uint64_t>(i));
      counter.Advance();
    });
    cairn::Print(setting, rows);
    csv += cairn::CsvLines(setting, rows);
  }
  const cairn::Status status = csv_path.empty() ? cairn::Ok() : cairn::WriteFileAtomically(csv_path, csv);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.error().message.c_str());
  return status.ok() ? 0 : 1;
}
