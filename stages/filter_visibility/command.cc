#include "stages/filter_visibility/command.h"

#include <spdlog/spdlog.h>

#include "core/line/memory.h"
#include "stages/filter_visibility/filter_visibility.h"

namespace cairn::filter_visibility {
namespace {

// Bytes of memory per byte of the input file.
constexpr double kMemoryPerFileByte = 1.5;

struct Arguments {
  std::string classes;
  std::string output;
  FilterVisibilityOptions options;
  OptionArguments option_arguments;
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_RETURN_IF_ERROR(CheckMemoryForFile("filtering the classes", arguments.classes, kMemoryPerFileByte,
                                           environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes));
  CAIRN_ASSIGN_OR_RETURN(const FilterVisibilityResult result, FilterVisibility(classes, arguments.options));
  const World& world = result.world;
  // A map that does not choose its landmarks by regions needs no feature of the world.
  if (world.num_features() == 0)
    spdlog::warn("{}: {}", arguments.classes, WhyNoFeature(result, classes.classes.size()));
  environment.report->in = {{"classes", static_cast<int64_t>(classes.classes.size())}};
  environment.report->out = {{"classes", world.num_features()}, {"stations", world.num_stations()}};
  AddDropped("classes", result.dropped, environment.report);
  *environment.out << fmt::format("filter_visibility: {} survey, {} stations, {} of {} classes kept\n",
                                  result.is_lattice ? "lattice" : "driven", world.num_stations(),
                                  world.num_features(), classes.classes.size());
  for (const auto& [reason, count] : result.dropped)
    *environment.out << fmt::format("filter_visibility: {} classes dropped: {}\n", count, reason);
  const bool json = arguments.output.ends_with(".json");
  return json ? WriteWorldJson(world, arguments.output)
              : WriteWorldDatabase(world, arguments.output, result.dropped_items);
}

}  // namespace

Command FilterVisibilityCommand() {
  auto arguments = std::make_shared<Arguments>();
  Command command;
  command.name = "filter-visibility";
  command.summary = "Find stations, and the feature classes that are widely visible (stage 4)";
  command.add_arguments = [arguments](ArgumentParser& parser) {
    parser.Add("classes", arguments->classes, "feature classes (classes.db)").Required().Type("FILE");
    parser.Add("-o,--output", arguments->output, "world to write: .json, or else a database")
        .Required()
        .Type("FILE");
    arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
  };
  command.run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); };
  return command;
}

}  // namespace cairn::filter_visibility
