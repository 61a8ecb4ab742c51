#include "stages/match_features/command.h"

#include <optional>

#include "stages/match_features/match_features.h"

namespace cairn {
namespace {

struct Arguments {
  std::string features;
  std::string capture;
  std::string output;
  MatchFeaturesOptions options;
  OptionArguments option_arguments;
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  std::optional<Capture> capture;
  if (!arguments.capture.empty()) {
    CAIRN_ASSIGN_OR_RETURN(capture, ReadCapture(arguments.capture));
  }
  CAIRN_ASSIGN_OR_RETURN(const MatchFeaturesSummary summary,
                         MatchFeatures(arguments.features, capture ? &*capture : nullptr, arguments.options,
                                       arguments.output, environment.num_threads, *environment.progress));
  *environment.out << fmt::format(
      "match_features: {} images, {} pairs tried ({}), {} verified, {} of {} matches\n", summary.num_images,
      summary.num_pairs_tried, summary.pairs, summary.num_pairs_verified, summary.num_inliers,
      summary.num_putative);
  return Ok();
}

}  // namespace

Command MatchFeaturesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "match-features",
          .summary = "Match and verify image pairs (stage 2)",
          .add_arguments =
              [arguments](CLI::App& app) {
                app.add_option("features", arguments->features, "COLMAP database with features")
                    ->required()
                    ->type_name("features.db");
                app.add_option("--capture", arguments->capture,
                               "Capture folder: its poses choose and verify pairs");
                app.add_option("-o,--output", arguments->output, "COLMAP database to write")
                    ->required()
                    ->type_name("matches.db");
                arguments->option_arguments.Add(app, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn
