#include "stages/extract_features/command.h"

#include <algorithm>
#include <filesystem>

#include <spdlog/spdlog.h>

#include "core/files/disk_space.h"
#include "core/files/file.h"
#include "core/line/reuse_arguments.h"
#include "stages/extract_features/dependency_file.h"
#include "stages/extract_features/extract_features.h"
#include "stages/extract_features/resources.h"

namespace cairn::extract_features {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string capture;
  std::string output;
  std::string depfile;
  bool no_space_check = false;
  ExtractFeaturesOptions options;
  OptionArguments option_arguments;
  ReuseArguments reuse;
};

Status WriteDependencyFile(const std::string& path, const Capture& capture, std::vector<std::string> inputs) {
  std::vector<std::string> roots = {capture.root};
  std::error_code error;
  if (fs::is_directory(capture.images_folder, error)) {
    for (std::string& folder : FoldersOf(inputs, capture.images_folder)) inputs.push_back(std::move(folder));
  }
  for (const std::string& input : inputs) {
    if (!input.starts_with(capture.root + "/")) roots.push_back(fs::path(input).parent_path());
  }
  std::sort(roots.begin() + 1, roots.end());
  roots.erase(std::unique(roots.begin() + 1, roots.end()), roots.end());
  return WriteFileAtomically(path, DependencyFile(inputs, roots));
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const ReuseOptions reuse, arguments.reuse.Apply(arguments.output));
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  for (const std::string& warning : capture.warnings) spdlog::warn("{}", warning);
  for (const std::string& note : capture.notes) spdlog::info("{}", note);
  if (!arguments.no_space_check) {
    CAIRN_RETURN_IF_ERROR(CheckDiskSpace(fmt::format("the features of {} images", capture.images.size()),
                                         fs::absolute(arguments.output).parent_path(),
                                         EstimateFeaturesBytes(capture, arguments.options)));
  }
  CAIRN_ASSIGN_OR_RETURN(
      const int num_threads,
      ThreadsThatFit(capture, arguments.options, environment.num_threads, environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(const ExtractFeaturesSummary summary,
                         ExtractFeatures(capture, arguments.options, arguments.output, num_threads,
                                         *environment.progress, reuse));
  for (const std::string& message : summary.not_reused) spdlog::debug("nothing taken over: {}", message);
  for (const std::string& line : RejectLines("images", summary.rejects)) spdlog::warn("{}", line);
  if (!arguments.depfile.empty()) {
    CAIRN_RETURN_IF_ERROR(WriteDependencyFile(arguments.depfile, capture, summary.inputs));
  }
  environment.report->in = {{"images", static_cast<int64_t>(summary.num_images + summary.rejects.size())}};
  environment.report->out = {{"images", summary.num_views}, {"keypoints", summary.num_keypoints}};
  environment.report->taken_over = {{"images", summary.num_taken_over}};
  AddRejects("images", summary.rejects, environment.report);
  *environment.out << fmt::format(
      "extract_features: {}{} images, {} keypoints ({:.0f} an image), {} rejected, {} taken over\n",
      reuse.shard ? fmt::format("shard {}/{}: ", reuse.shard->index, reuse.shard->count) : "",
      summary.num_views, summary.num_keypoints,
      static_cast<double>(summary.num_keypoints) / std::max(1, summary.num_views), summary.rejects.size(),
      summary.num_taken_over);
  return Ok();
}

}  // namespace

Command ExtractFeaturesCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "extract-features",
          .summary = "Find SIFT features in the survey images of a capture (stage 1)",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser
                    .Add("capture", arguments->capture,
                         "Capture folder (COLMAP text layout, or a flat folder of images)")
                    .Required()
                    .Type("CAPTURE");
                parser.Add("-o,--output", arguments->output, "COLMAP database to write")
                    .Required()
                    .Type("features.db");
                parser
                    .Add("--depfile", arguments->depfile,
                         "Also write a fragment for Make that adds every file read and its folder to the "
                         "variable CAPTURE_IMAGES")
                    .Type("FILE.d");
                arguments->reuse.Add(parser, "images");
                parser.AddFlag("--no-space-check", arguments->no_space_check,
                               "Begin even if the disk seems too full for the result");
                arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
          .may_be_output = {"--reuse"}};
}

}  // namespace cairn::extract_features
