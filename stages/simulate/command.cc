#include "stages/simulate/command.h"

#include <memory>
#include <string>

#include "stages/simulate/read_recipe.h"
#include "stages/simulate/simulate.h"

namespace cairn {
namespace {

struct Arguments {
  std::string recipe_path;
  std::string output_path;
  SimulateOptions options;
  OptionArguments option_arguments;
};

// Takes options and seed from a recipe's [simulate] table, or the options from a file that holds only such a
// table's keys.  Other tables are other stages'.
Status ReadRecipe(const std::string& path, SimulateOptions* options, uint64_t* seed) {
  CAIRN_ASSIGN_OR_RETURN(const toml::table document, ReadTomlFile(path));
  const toml::node* node = document.get("simulate");
  if (node == nullptr && (document.contains("name") || document.contains("capture"))) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: a recipe without [simulate]: there is nothing to render; add the table, or compile the "
        "recipe's own capture",
        path);
  }
  if (node == nullptr) return SetOptionsFromToml(document, path, DescribeOptions(options));
  if (!node->is_table()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: 'simulate' is not a table; write [simulate]",
                     TomlPlace(path, *node));
  }
  if (const toml::node* seed_node = document.get("seed")) {
    const auto* value = seed_node->as_integer();
    if (value == nullptr || value->get() < 0) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: seed: expected an integer of at least 0",
                       TomlPlace(path, *seed_node));
    }
    *seed = static_cast<uint64_t>(value->get());
  }
  OptionTable table = DescribeOptions(options);
  std::string floor_plan;  // which of the capture's files is the map's plan
  table.push_back({.name = "floor_plan", .value = &floor_plan, .help = "floor plan of the map"});
  return SetOptionsFromToml(*node->as_table(), path, table);
}

Status Run(const Arguments& given, const CommandEnvironment& environment, SimulateOptions* options) {
  uint64_t seed = environment.seed;
  if (!given.recipe_path.empty())
    CAIRN_RETURN_IF_ERROR(ReadSimulateRecipe(given.recipe_path, options, &seed));
  if (environment.seed_given) seed = environment.seed;
  CAIRN_RETURN_IF_ERROR(given.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(
      const SimulateResult result,
      SimulateCapture(*options, given.output_path, seed, environment.num_threads, *environment.progress));
  environment.report->out = {{"images", result.num_images}, {"queries", result.num_queries}};
  *environment.out << fmt::format("simulate: {} images from {} stations and {} queries, {} x {} pixels\n",
                                  result.num_images, result.num_stations, result.num_queries,
                                  options->image_width_px, options->image_height_px);
  return Ok();
}

}  // namespace

Command SimulateCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "simulate",
      .summary = "Renders a survey of a synthetic building, with known poses and held-out queries",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option(
                "recipe", arguments->recipe_path,
                "Recipe with a [simulate] table, or a file with that table's keys; without it, defaults");
            app.add_option("-o,--output", arguments->output_path, "Capture folder to write")->required();
            arguments->option_arguments.Add(app, DescribeOptions(&arguments->options));
          },
      .run =
          [arguments](const CommandEnvironment& environment) {
            return Run(*arguments, environment, &arguments->options);
          },
  };
}

}  // namespace cairn
