#include "stages/emit_map/leave_out/command.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/capture/capture.h"
#include "core/files/folder.h"
#include "core/map/left_out_folder.h"
#include "core/options/toml_options.h"
#include "stages/emit_map/emit_map.h"
#include "stages/emit_map/leave_out/choose_runs.h"
#include "stages/emit_map/leave_out/left_out_map.h"

namespace cairn::emit_map {
namespace {

struct Arguments {
  std::string map_path;
  std::string matches_path;
  SurveyFiles files;
  std::string output_path;
  LeaveOutOptions options;
  OptionArguments option_arguments;
};

// Sets those options of the table that a stage had when the map was made.
Status SetFromMap(const MapRows& rows, const std::string& map_path, const std::string& stage,
                  const OptionTable& table) {
  const auto recorded = rows.stage_options.find(stage);
  if (recorded == rows.stage_options.end()) return Ok();
  const std::string place = map_path + ": options of " + stage;
  CAIRN_ASSIGN_OR_RETURN(toml::table keys, ParseToml(recorded->second, place));
  for (auto key = keys.begin(); key != keys.end();) {
    const bool is_known = std::any_of(table.begin(), table.end(),
                                      [&](const Option& option) { return option.name == key->first.str(); });
    key = is_known ? std::next(key) : keys.erase(key);
  }
  return SetOptionsFromToml(keys, place, table);
}

Result<WholeMap> ReadWholeMap(const Arguments& arguments) {
  WholeMap whole;
  whole.matches_path = arguments.matches_path;
  CAIRN_ASSIGN_OR_RETURN(whole.rows, ReadMapRows(arguments.map_path));
  CAIRN_RETURN_IF_ERROR(
      SetFromMap(whole.rows, arguments.map_path, "emit_map", DescribeOptions(&whole.options)));
  TriangulateOptions& triangulation = whole.triangulation;
  CAIRN_RETURN_IF_ERROR(SetFromMap(
      whole.rows, arguments.map_path, "group_classes",
      {{.name = "min_num_observations", .value = &triangulation.min_num_observations, .help = ""},
       {.name = "max_reprojection_error_px", .value = &triangulation.max_reprojection_error_px, .help = ""},
       {.name = "min_triangulation_angle_deg",
        .value = &triangulation.min_triangulation_angle_deg,
        .help = ""}}));
  CAIRN_ASSIGN_OR_RETURN(static_cast<SurveyData&>(whole), ReadSurveyFiles(arguments.files));
  return whole;
}

// Writes a map and the images that try it for each round.
Status WriteRounds(const WholeMap& whole, const LeftOutRuns& runs, LeaveOutOptions options,
                   const std::string& folder, const CommandEnvironment& environment) {
  Progress& progress = *environment.progress;
  progress.Begin("maps without runs of images", static_cast<int64_t>(runs.rounds.size()), "maps");
  for (size_t round = 0; round < runs.rounds.size(); ++round) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "leaving images out was stopped");
    CAIRN_ASSIGN_OR_RETURN(MapRows rows, MakeLeftOutMap(whole, runs.rounds[round], environment.num_threads));
    rows.stage_options["leave_out"] = OptionsToml(DescribeOptions(&options));
    const LeftOutFolder::Round paths = LeftOutRound(folder, round);
    CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, paths.map_path));
    CAIRN_RETURN_IF_ERROR(WriteImagesText(paths.list_path, TriedImages(whole.classes, runs.rounds[round])));
    progress.Advance();
  }
  progress.End();
  return WriteLeftOutSummary(folder, runs.num_runs, runs.rounds.size());
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  if (arguments.options.hold_out == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "hold_out = 0 leaves nothing out, so there is nothing to do; give a ratio, or \"auto\"");
  }
  CAIRN_RETURN_IF_ERROR(CheckMemoryForSurvey("making maps without some images", arguments.files,
                                             /*by_trial=*/true, environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(const WholeMap whole, ReadWholeMap(arguments));
  CAIRN_ASSIGN_OR_RETURN(const auto never_tried, NeverTried(whole.classes, arguments.matches_path));
  Result<LeftOutRuns> runs = ChooseRuns(whole.classes, arguments.options, never_tried);
  if (!runs.ok() && runs.error().code != ErrorCode::kNoData) return runs.error();
  std::optional<std::string> reason;
  if (!runs.ok()) reason = runs.error().message;
  CAIRN_RETURN_IF_ERROR(ReplaceFolderAtomically(
      arguments.output_path, "a folder of left-out images", [&](const std::string& folder) -> Status {
        if (!reason) {
          const Status written = WriteRounds(whole, *runs, arguments.options, folder, environment);
          if (written.ok() || written.error().code != ErrorCode::kNoData) return written;
          reason = "without some of the survey's images no landmark is left: " + written.error().message;
        }
        return WriteNothingLeftOut(folder, *reason);
      }));
  environment.report->in = {{"survey images", static_cast<int64_t>(whole.classes.images.size())}};
  int64_t num_tried = 0;
  if (!reason) {
    for (const LeftOutImages& round : runs->rounds) num_tried += static_cast<int64_t>(round.tried.size());
  }
  environment.report->out = {{"left out", num_tried}};
  *environment.out << (reason ? fmt::format("leave_out: no image is left out: {}\n", *reason)
                              : fmt::format("leave_out: {} of {} survey images in {} runs, in {} maps\n",
                                            num_tried, whole.classes.images.size(), runs->num_runs,
                                            runs->rounds.size()));
  return Ok();
}

}  // namespace

Command LeaveOutCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "leave-out",
      .summary = "Make maps without runs of the survey's images, which try them (stage 9b)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "the map of all images, from emit-map")
                .Required()
                .Type("MAP");
            parser.Add("--matches", arguments->matches_path, "matches.db, for the features")
                .Required()
                .Type("matches.db");
            AddSurveyFiles("appearance.db: which images are kept [not in the maps]", parser,
                           &arguments->files);
            parser.Add("-o,--output", arguments->output_path, "folder to write, for cairn check --left-out")
                .Required()
                .Type("FOLDER");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
  };
}

}  // namespace cairn::emit_map
