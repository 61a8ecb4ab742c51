#include "sim/worlds/command.h"

#include <spdlog/spdlog.h>

#include "sim/worlds/simulate_worlds.h"

namespace cairn::sim {
namespace {

struct Arguments {
  std::string output;
  SimulateWorldsOptions options;
  OptionArguments option_arguments;
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const World world, SimulateWorld(arguments.options, environment.seed));
  spdlog::info("{} stations, {} features, {:.1f} visible from a station", world.num_stations(),
               world.num_features(), static_cast<double>(world.num_incidences()) / world.num_stations());
  const bool json = arguments.output.ends_with(".json");
  return json ? WriteWorldJson(world, arguments.output) : WriteWorldDatabase(world, arguments.output);
}

}  // namespace

Command SimulateWorldsCommand() {
  auto arguments = std::make_shared<Arguments>();
  Command command;
  command.name = "simulate-worlds";
  command.summary = "Draw a random world seen from above, to try region algorithms on";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("-o,--output", arguments->output, "world to write: .json, or else a database")
        .Required()
        .Type("FILE");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); };
  return command;
}

}  // namespace cairn::sim
