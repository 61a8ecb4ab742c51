#include "stages/decompose_regions/command.h"

#include <spdlog/spdlog.h>

#include "core/files/file.h"
#include "core/line/memory.h"
#include "stages/decompose_regions/cover/reduced_world.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "stages/decompose_regions/list_dropped.h"
#include "stages/decompose_regions/picture.h"

namespace cairn::decompose_regions {
namespace {

// Bytes of memory per byte of the world, and of the classes from which landmarks are chosen.
constexpr double kMemoryPerWorldByte = 8;
constexpr double kMemoryPerClassesByte = 1.5;

struct Arguments {
  std::string world;
  std::string classes;
  std::string output;
  std::string svg;
  DecomposeRegionsOptions options;
  OptionArguments option_arguments;
};

void WarnIfDisconnected(const World& world) {
  std::vector<StationIdx> all(world.num_stations());
  for (StationIdx station = 0; station < world.num_stations(); ++station) all[station] = station;
  const IndexLists neighbours = NeighbourLists(world);
  const auto components = ComponentFinder(neighbours).Components(all);
  if (components.size() < 2) return;
  spdlog::warn(
      "the graph of stations has {} unconnected parts, and no region spans two (station {} is not connected "
      "to {})",
      components.size(), components[1][0], components[0][0]);
}

// A world of which no station is coverable has no region, which a warning says: a map that chooses its
// landmarks otherwise needs none.
Result<Decomposition> Decompose(const World& world, const Arguments& arguments,
                                const CommandEnvironment& environment) {
  const DecomposeRegionsOptions& options = arguments.options;
  Result<Decomposition> result =
      DecomposeRegions(world, options, environment.seed, environment.num_threads, *environment.progress);
  if (result.ok()) return result;
  if (result.error().code != ErrorCode::kNoData || world.num_stations() == 0 ||
      !CoverableStations(world, options.k, options.tau).empty()) {
    return MakeError(result.error().code, "{}: {}", arguments.world, result.error().message);
  }
  spdlog::warn("{}: there is no region, as {}", arguments.world, result.error().message);
  return Decomposition{.algorithm = options.algorithm,
                       .k = options.k,
                       .tau = options.tau,
                       .rho = options.rho,
                       .seed = environment.seed};
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (arguments.classes.empty()) {
    ChooseFeaturesOptions of_choice;
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        NamesOf(DescribeOptions(&of_choice)),
        "chooses features among those of the classes; give --classes, or leave it out"));
  }
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFile("decomposing the world", arguments.world, kMemoryPerWorldByte,
                                           environment.memory_mib));
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFile("choosing landmarks by the classes", arguments.classes,
                                           kMemoryPerClassesByte, environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(const World world, ReadWorld(arguments.world));
  WarnIfDisconnected(world);
  Result<Decomposition> result = Decompose(world, arguments, environment);
  if (!result.ok()) return result.error();
  if (!arguments.classes.empty() && !result->regions.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes));
    result = ChooseFeatures(world, classes, *result, arguments.options.choose_features);
    if (!result.ok()) {
      return MakeError(result.error().code, "{}, {}: {}", arguments.world, arguments.classes,
                       result.error().message);
    }
  }
  const Decomposition& decomposition = *result;
  const bool is_large = world.num_stations() > arguments.options.best_max_stations;
  if (is_large && arguments.options.algorithm != "best" && arguments.options.lower_bound == "certified") {
    spdlog::warn(
        "{} stations are more than best_max_stations = {}: the lower bound is counted, not certified",
        world.num_stations(), arguments.options.best_max_stations);
  }
  if (is_large && arguments.options.algorithm == "best") {
    spdlog::warn(
        "{} stations are more than best_max_stations = {}: the regions are those of b2, the lower bound is "
        "counted",
        world.num_stations(), arguments.options.best_max_stations);
  }
  environment.report->in = {{"stations", world.num_stations()}, {"classes", world.num_features()}};
  environment.report->out = {{"regions", static_cast<int64_t>(decomposition.regions.size())}};
  AddDropped("stations", {{"in no region", static_cast<int64_t>(decomposition.uncovered.size())}},
             environment.report);
  *environment.out << fmt::format("decompose_regions: {} stations, {} features; {}\n", world.num_stations(),
                                  world.num_features(),
                                  NumRegionsText(decomposition.regions.size(), decomposition.lower_bound));
  if (!decomposition.uncovered.empty()) {
    spdlog::warn(
        "{} coverable stations are in no region (rho = {} lets small remainders go); first: station {}",
        decomposition.uncovered.size(), decomposition.rho, decomposition.uncovered[0]);
  }
  if (!arguments.svg.empty()) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.svg, DrawDecomposition(world, decomposition)));
  }
  return WriteDecomposition(decomposition, arguments.output, ListDropped(world, decomposition));
}

}  // namespace

Command DecomposeRegionsCommand() {
  auto arguments = std::make_shared<Arguments>();
  Command command;
  command.name = "decompose-regions";
  command.summary = "Divide the stations into few regions that see the same k features (stage 5)";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("world", arguments->world, "world: database (world.db) or JSON").Required().Type("FILE");
    parser
        .Add("--classes", arguments->classes,
             "feature classes that the world was made from (classes.db): regions then keep the features that "
             "determine poses best (--feature-choice)")
        .Type("FILE");
    parser.Add("-o,--output", arguments->output, "regions to write: .json, or else a database")
        .Required()
        .Type("FILE");
    parser.Add("--svg", arguments->svg, "also draw the regions as SVG").Type("FILE.svg");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); };
  return command;
}

}  // namespace cairn::decompose_regions
