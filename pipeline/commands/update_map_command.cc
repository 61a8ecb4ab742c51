#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "core/files/file.h"
#include "pipeline/build/build_files.h"
#include "pipeline/build/folder_lock.h"
#include "pipeline/build/make_words.h"
#include "pipeline/build/recipe.h"
#include "pipeline/build/recipe_source.h"
#include "pipeline/build/stage_options.h"
#include "pipeline/commands/commands.h"
#include "pipeline/commands/compile.h"
#include "pipeline/exchange/export/map_capture.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

struct UpdateMapArguments {
  std::string map;
  std::string survey;
  bool anew = false;
  CompileArguments compile;
};

// Where the captures of the old map are in the build folder of the new one.
std::string MapFolder(const BuildPaths& paths, const std::string& map) {
  return paths.build_dir + "/map-" + NameOfFolder(fs::path(map).stem().string());
}

// The name of the new session: that of its folder or file, and a number where the map has one of this name.
std::string NameOfSession(const std::string& survey, const std::vector<MapCapture>& captures) {
  const std::string name = NameOfFolder(fs::absolute(survey).lexically_normal().string());
  const auto is_taken = [&](const std::string& candidate) {
    return std::any_of(captures.begin(), captures.end(),
                       [&](const MapCapture& capture) { return capture.session == candidate; });
  };
  std::string candidate = name;
  for (int number = 2; is_taken(candidate); ++number) candidate = fmt::format("{}-{}", name, number);
  return candidate;
}

// The options, with the map as the one that is to change as little as it can.
std::string WithPrevious(std::string options, const std::string& map) {
  const std::string line = fmt::format("previous = \"{}\"\n", map), table = "[emit_map]\n";
  const size_t found = options.find(table);
  if (found == std::string::npos) return options + "\n" + table + line;
  return options.insert(found + table.size(), line);
}

// Paths are relative to the recipe.
Result<std::string> RecipeOfUpdate(const MapRows& rows, const std::vector<MapCapture>& captures,
                                   const UpdateMapArguments& arguments, const fs::path& recipe_folder) {
  std::string text = fmt::format(
      "# {}, each of its sessions as a capture of its landmarks, and what is new.  Every key that is not "
      "here "
      "has its\n# default; docs/recipe.md lists them.\nname = \"{}\"\n",
      NameOfFolder(fs::path(arguments.map).filename().string()), NameOfMap(rows));
  // Larger ones are no recipe's.
  if (rows.seed > 0 && rows.seed <= static_cast<uint64_t>(std::numeric_limits<int64_t>::max()))
    text += fmt::format("seed = {}\n", rows.seed);
  const Eigen::Vector3d up = UpOfMap(rows);
  for (const MapCapture& capture : captures) {
    text += fmt::format("\n[[capture]]\npath = \"{}\"\nname = \"{}\"\nup = [{}, {}, {}]\n",
                        fs::path(capture.folder).lexically_relative(recipe_folder).string(), capture.session,
                        up.x(), up.y(), up.z());
  }
  fs::path survey = fs::absolute(arguments.survey).lexically_normal();
  if (!survey.has_filename()) survey = survey.parent_path();  // a trailing '/'
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the capture", survey.string()));
  std::error_code error;
  text += fmt::format("\n[[capture]]\npath = \"{}\"\nname = \"{}\"\n",
                      survey.lexically_relative(recipe_folder).string(),
                      NameOfSession(arguments.survey, captures));
  // Poses of its own are in a frame of their own, whatever it is called.
  if (fs::exists(survey / "images.txt", error)) text += "frame = \"register\"\n";
  std::vector<std::pair<std::string, OptionTable>> stages;
  const std::vector<StageOptions> all = AllStageOptions();
  for (const StageOptions& stage : all) stages.emplace_back(stage.stage, stage.table);
  CAIRN_ASSIGN_OR_RETURN(const std::string options, OptionsOfMap(rows, stages));
  if (arguments.anew) return text + options;
  const fs::path map = fs::path(captures[0].folder).parent_path() / kCapturedMapFile;
  return text + WithPrevious(options, map.lexically_relative(recipe_folder).string());
}

// Whether a run until this stage finds poses.
bool FindsPoses(std::string until) {
  std::replace(until.begin(), until.end(), '-', '_');
  return until != "import" && until != "extract_features" && until != "match_features";
}

// A map that nothing was added to is the old one with what it kept of its survey, and so with less: who puts
// it in the old one's place every night would see it fade.  Errors: NoData (no image of the session was
// joined).
Status CheckIsJoined(const BuildPaths& paths, const std::string& session,
                     const UpdateMapArguments& arguments) {
  const std::string path = paths.build_dir + "/poses/reconstruction.json";
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  const auto report = nlohmann::json::parse(text, nullptr, false);
  if (report.is_discarded() || !report.contains("sessions")) return Ok();
  for (const auto& of_session : report["sessions"]) {
    if (of_session.value("name", "") != session || of_session.value("num_joined", 1) > 0) continue;
    return MakeError(ErrorCode::kNoData,
                     "no image of {} is joined to {} ({} has the reasons): there is nothing to update it by; "
                     "keep it, as {} is made of its landmarks alone",
                     arguments.survey, arguments.map, path, arguments.compile.output);
  }
  return Ok();
}

Status UpdateMap(UpdateMapArguments arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(CheckIsSurvey(arguments.survey));
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(arguments.map));
  const fs::path recipe = fs::path(arguments.compile.output).replace_extension(".toml");
  arguments.compile.recipe = recipe.string();
  CAIRN_ASSIGN_OR_RETURN(const BuildPaths paths, ResolvePaths(arguments.compile));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the build folder", paths.build_dir));
  std::vector<MapCapture> captures;
  {
    CAIRN_ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Acquire(paths.build_dir, NewBuildSession()));
    CAIRN_ASSIGN_OR_RETURN(captures, WriteMapCaptures(rows, MapFolder(paths, arguments.map), arguments.map));
  }
  int num_images = 0;
  int64_t num_keypoints = 0;
  for (const MapCapture& capture : captures) {
    num_images += capture.num_images;
    num_keypoints += capture.num_keypoints;
  }
  *environment.out << fmt::format("update_map: {} landmarks of map '{}' are {} keypoints in {} images\n",
                                  rows.landmarks.size(), rows.name, num_keypoints, num_images);
  if (!rows.views.plan.walls.empty()) {
    spdlog::warn(
        "{}: has a floor plan, which is not taken over: add floor_plan = \"FILE\" to the first [[capture]] "
        "of "
        "{} and compile that",
        arguments.map, arguments.compile.recipe);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::string text,
                         RecipeOfUpdate(rows, captures, arguments, fs::path(paths.recipe).parent_path()));
  CAIRN_ASSIGN_OR_RETURN(const bool is_new,
                         WriteNewRecipe(arguments.compile.recipe, text,
                                        fmt::format("updates {} by {}", arguments.map, arguments.survey),
                                        arguments.compile.output));
  if (is_new) {
    *environment.out << fmt::format("{}: the recipe of this; to change something, edit it and compile it\n",
                                    arguments.compile.recipe);
  }
  CAIRN_RETURN_IF_ERROR(Compile(arguments.compile, environment));
  return FindsPoses(arguments.compile.until)
             ? CheckIsJoined(paths, NameOfSession(arguments.survey, captures), arguments)
             : Ok();
}

}  // namespace

Command UpdateMapCommand() {
  const auto arguments = std::make_shared<UpdateMapArguments>();
  return {.name = "update-map",
          .summary = "Compile a map and tonight's images into a new map, where only the map is left",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser.Add("map", arguments->map, "Map to update; its survey is not needed")
                    .Required()
                    .Type("OLD.cairn");
                parser
                    .Add("survey", arguments->survey,
                         "What is new: a folder of images, with or without poses, a film or a ROS bag; it is "
                         "registered to the map by what its images see of it")
                    .Required()
                    .Type("FOLDER|FILM|BAG");
                parser
                    .Add("-o,--output", arguments->compile.output,
                         "Map to write; the recipe NAME.toml is written beside it")
                    .Required()
                    .Type("NAME.cairn");
                parser.AddFlag(
                    "--anew", arguments->anew,
                    "Choose all landmarks anew: a smaller map after many updates, but robots that have "
                    "the old one are sent nearly all of it [what still holds of the old map stays]");
                parser
                    .Add("--build-dir", arguments->compile.build_dir,
                         "Folder for the stages' files [NAME.build beside the map]")
                    .Type("FOLDER");
                AddRunArguments(parser, &arguments->compile);
              },
          .run = [arguments](
                     const CommandEnvironment& environment) { return UpdateMap(*arguments, environment); }};
}

}  // namespace cairn::pipeline
