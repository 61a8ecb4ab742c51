// B.2 from five thousand stations to a million.
//   regions_scale --stations 100000,300000,1000000
//
// First, worlds of about 5,000 stations in memory, many times each: milliseconds of processor time.  Then
// large worlds of the same density, 100 features visible from a station: each is written as world.db, and a
// process of its own reads it and decomposes it, so that its peak of memory is that of the program.
// Exponent: of processor seconds (reading included) from the smallest to the largest world.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <vector>

#include <CLI/CLI.hpp>

#include "sim/worlds/simulate_worlds.h"
#include "stages/decompose_regions/decompose_regions.h"

namespace cairn {
namespace {

// Of setting 1 per unit of area_scale, in large worlds: they have fewer walls at the perimeter.
constexpr double kStationsPerScale = 5940;
constexpr int kFeaturesForHundredVisible = 4960;

using Clock = std::chrono::steady_clock;
double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double ProcessorSeconds(const rusage& usage) {
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

void MeasureSmallWorlds(const decompose_regions::DecomposeRegionsOptions& options, int num_runs) {
  fmt::print("{:>8}{:>10}{:>10}{:>9}{:>10}{:>14}{:>11}\n", "setting", "stations", "visible", "regions",
             "best, ms", "median, ms", "slowest");
  for (int setting = 1; setting <= 4; ++setting) {
    // Of the first worlds the one that is nearest to 5,000 stations.
    World nearest;
    for (uint64_t seed = 0; seed < 40; ++seed) {
      Result<World> world = sim::SimulateWorld({.setting = setting}, seed);
      if (!world.ok()) continue;
      const auto distance = [](const World& w) { return std::abs(w.num_stations() - 5000); };
      if (distance(*world) < distance(nearest)) nearest = std::move(*world);
    }
    std::vector<double> milliseconds;
    size_t num_regions = 0;
    for (int run = 0; run < num_runs; ++run) {
      const std::clock_t start = std::clock();
      const Result<Decomposition> result =
          decompose_regions::DecomposeRegions(nearest, options, static_cast<uint64_t>(run));
      milliseconds.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
      if (result.ok()) num_regions = result->regions.size();
    }
    std::sort(milliseconds.begin(), milliseconds.end());
    fmt::print("{:>8}{:>10}{:>10.1f}{:>9}{:>10.1f}{:>14.1f}{:>11.1f}\n", setting, nearest.num_stations(),
               static_cast<double>(nearest.num_incidences()) / nearest.num_stations(), num_regions,
               milliseconds.front(), milliseconds[milliseconds.size() / 2], milliseconds.back());
    std::fflush(stdout);
  }
}

// Runs `body` in a process of its own and returns what it used.
rusage RunApart(const std::function<bool()>& body) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    const bool ok = body();
    std::fflush(stdout);
    _exit(ok ? 0 : 1);
  }
  int status = 0;
  rusage usage{};
  if (child < 0 || wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) ||
      WEXITSTATUS(status) != 0) {
    fmt::print(stderr, "the measured process failed\n");
    std::exit(1);
  }
  return usage;
}

bool WriteLargeWorld(int64_t num_stations, const std::string& path) {
  const sim::SimulateWorldsOptions options{
      .setting = 1,
      .num_features = kFeaturesForHundredVisible,
      .area_scale = static_cast<double>(num_stations) / kStationsPerScale};
  const Result<World> world = sim::SimulateWorld(options, 0);
  const Status status = world.ok() ? WriteWorldDatabase(*world, path) : Status(world.error());
  if (!status.ok()) fmt::print(stderr, "{}\n", status.error().message);
  return status.ok();
}

bool DecomposeFile(const std::string& path, const decompose_regions::DecomposeRegionsOptions& options) {
  const auto start = Clock::now();
  const Result<World> world = ReadWorldDatabase(path);
  if (!world.ok()) return false;
  const double reading = SecondsSince(start);
  const auto read = Clock::now();
  const Result<Decomposition> result = decompose_regions::DecomposeRegions(*world, options, 0);
  if (!result.ok()) return false;
  fmt::print("{:>10}{:>12.3g}{:>9}{:>12.2f}{:>14.2f}", world->num_stations(),
             static_cast<double>(world->num_incidences()), result->regions.size(), reading,
             SecondsSince(read));
  return true;
}

void MeasureLargeWorlds(const std::vector<int64_t>& sizes, const std::filesystem::path& folder,
                        const decompose_regions::DecomposeRegionsOptions& options) {
  fmt::print("\n{:>10}{:>12}{:>9}{:>12}{:>14}{:>16}{:>10}\n", "stations", "incidences", "regions",
             "reading, s", "regions, s", "processor, s", "GiB");
  std::vector<double> seconds;
  for (const int64_t size : sizes) {
    const std::string path = folder / fmt::format("scale{}.db", size);
    RunApart([&] { return WriteLargeWorld(size, path); });
    const rusage usage = RunApart([&] { return DecomposeFile(path, options); });
    seconds.push_back(ProcessorSeconds(usage));
    fmt::print("{:>16.2f}{:>10.2f}\n", seconds.back(), static_cast<double>(usage.ru_maxrss) / (1 << 20));
    std::fflush(stdout);
    std::filesystem::remove(path);
  }
  if (sizes.size() < 2) return;
  fmt::print("exponent from {} to {} stations: {:.3f}\n", sizes.front(), sizes.back(),
             std::log(seconds.back() / seconds.front()) /
                 std::log(static_cast<double>(sizes.back()) / static_cast<double>(sizes.front())));
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  CLI::App app("Time and memory of algorithm B.2, from 5,000 stations to a million");
  cairn::decompose_regions::DecomposeRegionsOptions options{
      .algorithm = "b2", .k = 4, .tau = 1, .rho = 9, .lower_bound = "none"};
  std::vector<int64_t> sizes = {100000, 300000, 1000000};
  std::string folder = std::filesystem::temp_directory_path();
  int num_runs = 50;
  app.add_option("--stations", sizes, "sizes of the large worlds")->delimiter(',')->capture_default_str();
  app.add_option("--runs", num_runs, "runs per small world; 0: none")->capture_default_str();
  app.add_option("--folder", folder, "where large worlds are written, 0.5 GB a million stations")
      ->capture_default_str();
  app.add_option("--k", options.k)->capture_default_str();
  app.add_option("--tau", options.tau)->capture_default_str();
  app.add_option("--rho", options.rho)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  fmt::print("algorithm b2, k = {}, tau = {}, rho = {}, one core\n", options.k, options.tau, options.rho);
  if (num_runs > 0) cairn::MeasureSmallWorlds(options, num_runs);
  cairn::MeasureLargeWorlds(sizes, folder, options);
  return 0;
}
