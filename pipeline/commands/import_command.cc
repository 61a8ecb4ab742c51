#include "pipeline/commands/commands.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include <spdlog/spdlog.h>

#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/write_capture.h"

namespace cairn::pipeline {
namespace {

struct ImportArguments {
  std::string source;
  std::string output;
  ImportOptions options;
  HoldOut hold_out;
  std::string link = "symbolic";
};

Status RunImport(const ImportArguments& arguments, const CommandEnvironment& environment) {
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

void AddArguments(ArgumentParser& parser, ImportArguments* arguments) {
  parser.Add("source", arguments->source, "Folder of the data set, or of a COLMAP model")
      .Required()
      .Type("SOURCE");
  parser.Add("-o,--output", arguments->output, "Capture folder to write").Required().Type("CAPTURE");
  parser
      .Add("--format", arguments->options.layout,
           "auto|colmap|tum|7scenes|kitti|euroc|kapture; auto: by the files that are there [auto]")
      .OneOf({"auto", "colmap", "tum", "7scenes", "kitti", "euroc", "kapture"})
      .Type("FORMAT");
  parser
      .Add("--camera", arguments->options.camera,
           "Camera of all images, in COLMAP's pixels [as the data set states]")
      .Type("MODEL,W,H,P...");
  parser
      .Add("--images", arguments->options.images_folder,
           "colmap: folder of the images [images/ in or beside the model]")
      .Type("FOLDER");
  parser.Add("--sequence", arguments->options.sequence, "kitti: the sequence [the only one]").Type("NN");
  parser
      .Add("--sensors", arguments->options.sensors,
           "Cameras to import: kitti image_0,image_1,.., euroc cam0,cam1, kapture sensor ids [the first; "
           "kapture: all]")
      .SeparatedByCommas()
      .Type("NAME,...");
  parser
      .Add("--max-time-gap-s", arguments->options.max_time_gap_s,
           "tum, euroc: a frame's pose lies between stated poses at most this far from it, seconds [0.02]")
      .NonNegative()
      .Type("FLOAT");
  parser.Add("--every", arguments->hold_out.every, "Hold out every N-th image as a query [none]")
      .Range(2, 1000000000)
      .Type("N");
  parser
      .Add("--queries", arguments->hold_out.queries_path,
           "Hold out the images that this file names, one per line [7scenes: TestSplit.txt]")
      .Type("FILE");
  parser
      .Add("--link", arguments->link, "symbolic|hard|copy: how image files come into the capture [symbolic]")
      .OneOf({"symbolic", "hard", "copy"})
      .Type("HOW");
}

}  // namespace

Command ImportCommand() {
  auto arguments = std::make_shared<ImportArguments>();
  return {
      .name = "import",
      .summary = "Make a capture of a COLMAP model, TUM RGB-D, 7-Scenes, KITTI, EuRoC or kapture",
      .add_arguments = [arguments](ArgumentParser& parser) { AddArguments(parser, arguments.get()); },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunImport(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
