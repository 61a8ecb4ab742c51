#include "stages/extract_features/command.h"

#include <spdlog/spdlog.h>

#include "core/file.h"
#include "stages/extract_features/extract_features.h"

namespace cairn {
namespace {

struct Arguments {
  std::string capture;
  std::string output;
  std::string depfile;
  std::string depfile_target;
  ExtractFeaturesOptions options;
  OptionArguments option_arguments;
};

// A file name as Make reads it.
std::string EscapeForMake(const std::string& name) {
  std::string escaped;
  for (const char c : name) {
    if (c == ' ' || c == '#' || c == ':') escaped += '\\';
    if (c == '$') escaped += '$';
    escaped += c;
  }
  return escaped;
}

// A rule for Make: the output depends on every input; inputs that vanish do not stop it.
std::string DependencyRule(const std::string& target, const std::vector<std::string>& inputs) {
  std::string rule = target + ":";
  for (const std::string& input : inputs) rule += " \\\n  " + EscapeForMake(input);
  rule += "\n";
  for (const std::string& input : inputs) rule += EscapeForMake(input) + ":\n";
  return rule;
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  for (const std::string& warning : capture.warnings) spdlog::warn("{}", warning);
  CAIRN_ASSIGN_OR_RETURN(const ExtractFeaturesSummary summary,
                         ExtractFeatures(capture, arguments.options, arguments.output,
                                         environment.num_threads, *environment.progress));
  for (const Reject& reject : summary.rejects) spdlog::warn("rejected {}: {}", reject.name, reject.reason);
  if (!arguments.depfile.empty()) {
    const std::string& target =
        arguments.depfile_target.empty() ? arguments.output : arguments.depfile_target;
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.depfile, DependencyRule(target, summary.inputs)));
  }
  *environment.out << fmt::format(
      "extract_features: {} images, {} keypoints ({:.0f} an image), {} rejected\n", summary.num_views,
      summary.num_keypoints, static_cast<double>(summary.num_keypoints) / summary.num_views,
      summary.rejects.size());
  return Ok();
}

}  // namespace

Command ExtractFeaturesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "extract-features",
          .summary = "Find SIFT features in the survey images of a capture (stage 1)",
          .add_arguments =
              [arguments](CLI::App& app) {
                app.add_option("capture", arguments->capture,
                               "Capture folder (COLMAP text layout, or a flat folder of images)")
                    ->required();
                app.add_option("-o,--output", arguments->output, "COLMAP database to write")
                    ->required()
                    ->type_name("features.db");
                app.add_option("--depfile", arguments->depfile,
                               "Also write a Make rule that names every file read")
                    ->type_name("FILE.d");
                app.add_option("--depfile-target", arguments->depfile_target,
                               "Target of that rule [the output]");
                arguments->option_arguments.Add(app, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn
