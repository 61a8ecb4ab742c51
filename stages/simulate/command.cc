#include "stages/simulate/command.h"

#include <memory>
#include <string>

#include "stages/simulate/read_recipe.h"
#include "stages/simulate/simulate.h"

namespace cairn::simulate {
namespace {

struct Arguments {
  std::string recipe_path;
  std::string output_path;
  sim::SimulateOptions options;
  OptionArguments option_arguments;
};

Status Run(const Arguments& given, const CommandEnvironment& environment, sim::SimulateOptions* options) {
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
      .summary = "Render a survey of a synthetic building, with poses and held-out queries",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser
                .Add("recipe", arguments->recipe_path,
                     "Recipe with a [simulate] table, or a file with that table's keys; without it, defaults")
                .Type("RECIPE.toml");
            parser.Add("-o,--output", arguments->output_path, "Capture folder to write")
                .Required()
                .Type("FOLDER");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run =
          [arguments](const CommandEnvironment& environment) {
            return Run(*arguments, environment, &arguments->options);
          },
  };
}

}  // namespace cairn::simulate
