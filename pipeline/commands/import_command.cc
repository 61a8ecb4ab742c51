#include "pipeline/commands/commands.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include <spdlog/spdlog.h>

#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/write_capture.h"

namespace cairn::pipeline {
namespace {

struct Arguments {
  std::string source;
  std::string output;
  ImportOptions options;
  HoldOut hold_out;
  std::string link = "symbolic";
};

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(ImportedSurvey survey, ReadSurvey(arguments.source, arguments.options));
  CAIRN_RETURN_IF_ERROR(ChooseQueries(arguments.hold_out, &survey));
  const ImageTransfer transfer = arguments.link == "copy"   ? ImageTransfer::kCopy
                                 : arguments.link == "hard" ? ImageTransfer::kHardLink
                                                            : ImageTransfer::kSymbolicLink;
  CAIRN_RETURN_IF_ERROR(WriteImportedCapture(survey, transfer, arguments.output, *environment.progress));
  for (const std::string& note : survey.notes) spdlog::warn("{}", note);
  if (!survey.left_out.empty()) {
    spdlog::warn("{} frames left out, listed in {}/left_out.txt; the first, {}: {}", survey.left_out.size(),
                 arguments.output, survey.left_out[0].name, survey.left_out[0].reason);
  }
  const auto num_queries = std::count_if(survey.images.begin(), survey.images.end(),
                                         [](const ImportedImage& image) { return image.is_query; });
  *environment.out << fmt::format("import: {} survey images, {} queries, {} cameras, {} frames left out\n",
                                  survey.images.size() - num_queries, num_queries, survey.cameras.size(),
                                  survey.left_out.size());
  return Ok();
}

void AddArguments(CLI::App& app, Arguments* arguments) {
  app.add_option("source", arguments->source, "Folder of the data set, or of a COLMAP model")
      ->required()
      ->type_name("SOURCE");
  app.add_option("-o,--output", arguments->output, "Capture folder to write")
      ->required()
      ->type_name("CAPTURE");
  app.add_option("--format", arguments->options.layout,
                 "auto|colmap|tum|7scenes|kitti|euroc|kapture; auto: by the files that are there [auto]")
      ->check(CLI::IsMember({"auto", "colmap", "tum", "7scenes", "kitti", "euroc", "kapture"}))
      ->type_name("FORMAT");
  app.add_option("--camera", arguments->options.camera,
                 "Camera of all images, in COLMAP's pixels [as the data set states]")
      ->type_name("MODEL,W,H,P...");
  app.add_option("--images", arguments->options.images_folder,
                 "colmap: folder of the images [images/ in or beside the model]")
      ->type_name("FOLDER");
  app.add_option("--sequence", arguments->options.sequence, "kitti: the sequence [the only one]")
      ->type_name("NN");
  app.add_option(
         "--sensors", arguments->options.sensors,
         "Cameras to import: kitti image_0,image_1,.., euroc cam0,cam1, kapture sensor ids [the first; "
         "kapture: all]")
      ->delimiter(',')
      ->type_name("NAME,...");
  app.add_option(
         "--max-time-gap-s", arguments->options.max_time_gap_s,
         "tum, euroc: a frame's pose lies between stated poses at most this far from it, seconds [0.02]")
      ->check(CLI::NonNegativeNumber)
      ->type_name("FLOAT");
  app.add_option("--every", arguments->hold_out.every, "Hold out every N-th image as a query [none]")
      ->check(CLI::Range(2, 1000000000))
      ->type_name("N");
  app.add_option("--queries", arguments->hold_out.queries_path,
                 "Hold out the images that this file names, one a line [7scenes: TestSplit.txt]")
      ->type_name("FILE");
  app.add_option("--link", arguments->link,
                 "symbolic|hard|copy: how image files come into the capture [symbolic]")
      ->check(CLI::IsMember({"symbolic", "hard", "copy"}))
      ->type_name("HOW");
}

}  // namespace

Command ImportCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "import",
      .summary = "Makes a capture of a COLMAP model, TUM RGB-D, 7-Scenes, KITTI, EuRoC or kapture data",
      .add_arguments = [arguments](CLI::App& app) { AddArguments(app, arguments.get()); },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
