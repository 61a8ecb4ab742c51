#include "pipeline/commands/compile.h"

#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "core/modules/program_files.h"
#include "pipeline/build/build_files.h"
#include "pipeline/build/build_folder.h"
#include "pipeline/build/build_report.h"
#include "pipeline/build/build_step.h"
#include "pipeline/build/folder_lock.h"
#include "pipeline/build/line.h"
#include "pipeline/build/recipe.h"
#include "pipeline/build/recipe_source.h"
#include "pipeline/build/run_make.h"
#include "pipeline/commands/commands.h"
#include "pipeline/program/stop_signal.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// Fills in what was not given: the recipe of a folder, the map's name.
Result<Recipe> ReadRecipeWithSeed(const CommandEnvironment& environment, CompileArguments* arguments) {
  CAIRN_ASSIGN_OR_RETURN(const RecipeSource source, FindRecipe(arguments->recipe, arguments->output));
  if (source.was_written) {
    *environment.out << fmt::format(
        "{}: the recipe of {}, with defaults; to change something, edit it and compile it\n", source.recipe,
        arguments->recipe);
  }
  CAIRN_ASSIGN_OR_RETURN(Recipe recipe, ReadRecipe(source.recipe, AllStageOptions()));
  arguments->recipe = source.recipe;
  arguments->output = source.map.empty() ? recipe.name + ".cairn" : source.map;
  if (environment.seed_given) recipe.seed = environment.seed;
  return recipe;
}

// What the films and bags of the recipe are called in the build folder.
std::set<std::string> FootageFolders(const Recipe& recipe) {
  std::set<std::string> names;
  for (const RecipeCapture& capture : recipe.captures) {
    if (capture.IsFootage()) names.insert(FootageFolderName(capture));
  }
  return names;
}

Result<std::string> MakeGoal(const std::string& until, const Recipe& recipe, const BuildPaths& paths) {
  if (until.empty() || until == "check_map" || until == "check-map") return paths.map;
  std::string stage = until;
  std::replace(stage.begin(), stage.end(), '-', '_');
  if (stage == "reconstruct" && !IsReconstructed(recipe)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--until {}: the capture has poses of its own (images.txt); nothing is reconstructed",
                     until);
  }
  if (stage == "decompose_views" && !HasFloorPlan(recipe)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--until {}: the recipe names no floor plan; add floor_plan = \"FILE\" to [[capture]]",
                     until);
  }
  if (stage == "leave_out" && !LeavesOut(recipe)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--until {}: nothing is left out of the survey: the capture has held-out images of its "
                     "own, or [leave_out] hold_out is 0",
                     until);
  }
  std::vector<std::string> stages;
  for (const LineStage& of_line : kLine) {
    const std::string file = of_line.file;
    if (std::string(of_line.name) == "join_captures") continue;
    if (std::string(of_line.name) == "import") {
      const std::set<std::string> footage = FootageFolders(recipe);
      if (footage.empty()) continue;
      const std::string last =
          recipe.captures.size() > 1 ? "capture" : *footage.begin();  // several are joined
      if (stage == of_line.name) return paths.build_dir + "/" + last + ".stamp";
    }
    if (stage == of_line.name) return paths.build_dir + "/" + (file == "capture" ? "capture.stamp" : file);
    stages.emplace_back(of_line.name);
  }
  const std::string nearest = NearestWord(stage, stages);
  return MakeError(
      ErrorCode::kInvalidArgument, "--until {}: no such stage; {}", until,
      nearest.empty() ? fmt::format("one of {}", fmt::join(stages, ", ")) : "did you mean " + nearest + "?");
}

// Dates of all stamps: a rule that ran has touched its own.
std::map<std::string, fs::file_time_type> StampDates(const std::string& build_dir) {
  std::map<std::string, fs::file_time_type> dates;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(build_dir, error)) {
    if (entry.path().extension() == ".stamp") dates[entry.path()] = entry.last_write_time(error);
  }
  return dates;
}

// Whether other keys of a [[capture]] may help: the bag has other topics, or no keyframe was found.
bool MayBeAnotherKey(const StageFailure& failure) {
  return failure.stage == "import" &&
         (failure.code == ErrorCode::kInvalidArgument || failure.code == ErrorCode::kNotFound ||
          failure.code == ErrorCode::kNoData);
}

// The stage has printed its message already.
Error StageError(const BuildPaths& paths, const CompileArguments& arguments) {
  const std::optional<StageFailure> failure = ReadErrorFile(paths.build_dir);
  if (failure) {
    const std::string remedy =
        MayBeAnotherKey(*failure)
            ? fmt::format(
                  "; {0} says under [[capture]] how it is imported: edit that, then run cairn compile {0} "
                  "-o {1}",
                  arguments.recipe, arguments.output)
            : "";
    return MakeError(failure->code, "stage {} failed; {} was not written{}", failure->stage, paths.map,
                     remedy);
  }
  return MakeError(
      ErrorCode::kFailed,
      "make stopped before a stage could report why: a stage was killed (out of memory? see --memory), or a "
      "rule failed as make says above; {} was not written",
      paths.map);
}

// Names of the outputs whose rules ran since.
std::set<std::string> RanSince(const std::map<std::string, fs::file_time_type>& before,
                               const std::string& build_dir) {
  std::set<std::string> ran;
  for (const auto& [path, date] : StampDates(build_dir)) {
    const auto old = before.find(path);
    if (old == before.end() || old->second != date) ran.insert(fs::path(path).stem().string());
  }
  return ran;
}

// Writes the build report beside the map; prints it as a table where something was done.
Status TellOfRun(const BuildRun& run, const BuildPaths& paths, std::ostream& out) {
  CAIRN_ASSIGN_OR_RETURN(const nlohmann::ordered_json report, MakeBuildReport(run));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
      ReportPath(paths.map),
      report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"));
  if (!run.ran.empty()) out << BuildReportTable(report);
  return Ok();
}

// Keys of the recipe that no stage reads.
void WarnOfUnreadKeys(const Recipe& recipe) {
  std::vector<std::pair<std::string, std::string>> skipped;
  if (!IsReconstructed(recipe)) skipped.emplace_back("reconstruct", "the capture has poses of its own");
  if (!HasFloorPlan(recipe)) skipped.emplace_back("decompose_views", "the recipe names no floor plan");
  if (HasQueries(recipe)) skipped.emplace_back("leave_out", "the capture has held-out images of its own");
  for (const std::string& line : UnreadKeys(recipe, skipped)) spdlog::warn("{}", line);
  const Result<bool> is_registered = IsRegistered(recipe);
  if (!is_registered.ok() || !*is_registered) return;
  for (const Recipe::Key& key : recipe.stage_keys) {
    static const std::set<std::string> kRead = {"refine_focal_length", "refine_distortion", "hold_out_every"};
    if (key.stage != "reconstruct" || kRead.contains(key.name)) continue;
    spdlog::warn(
        "{}: [reconstruct] {} is not read: captures without poses are registered to those that have some",
        key.place, key.name);
  }
}

Status Configure(CompileArguments arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipeWithSeed(environment, &arguments));
  CAIRN_ASSIGN_OR_RETURN(const BuildPaths paths, ResolvePaths(arguments));
  WarnOfUnreadKeys(recipe);
  CAIRN_ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Acquire(paths.build_dir, BuildSession()));
  return WriteBuildFolder(recipe, paths);
}

void AddRecipeArguments(ArgumentParser& parser, CompileArguments* arguments) {
  parser
      .Add("recipe", arguments->recipe,
           "Recipe of the map (docs/recipe.md), or a film, a ROS bag or the folder of a capture: then it is "
           "compiled with defaults, by the recipe NAME.toml that is written beside the map")
      .Required()
      .Type("RECIPE.toml|FILM|BAG|FOLDER");
  parser
      .Add("-o,--output", arguments->output,
           "Map to write [by the name of the recipe, film, bag or folder, in the current folder]")
      .Type("NAME.cairn");
  parser.Add("--build-dir", arguments->build_dir, "Folder for the stages' files [NAME.build beside the map]")
      .Type("FOLDER");
}

}  // namespace

Result<BuildPaths> ResolvePaths(const CompileArguments& arguments) {
  const fs::path map = fs::absolute(arguments.output).lexically_normal();
  if (map.extension() != ".cairn") {
    return MakeError(ErrorCode::kInvalidArgument, "-o {}: a map's name ends in .cairn", arguments.output);
  }
  std::error_code error;
  if (!fs::is_directory(map.parent_path(), error)) {
    return MakeError(ErrorCode::kIo, "{}: the folder {} does not exist; create it first", arguments.output,
                     map.parent_path().string());
  }
  fs::path build_dir = fs::path(map).replace_extension(".build");
  if (!arguments.build_dir.empty()) build_dir = fs::absolute(arguments.build_dir).lexically_normal();
  if (!build_dir.has_filename()) build_dir = build_dir.parent_path();  // a trailing '/'
  CAIRN_RETURN_IF_ERROR(CheckBuildFolder(build_dir.string()));
  CAIRN_ASSIGN_OR_RETURN(const std::string program, ProgramPath());
  return BuildPaths{.build_dir = build_dir.string(),
                    .map = map.string(),
                    .program = program,
                    .recipe = fs::absolute(arguments.recipe).lexically_normal().string()};
}

Status Compile(CompileArguments arguments, const CommandEnvironment& environment) {
  LiftStopDeadline();
  const auto begin = std::chrono::steady_clock::now();
  CAIRN_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipeWithSeed(environment, &arguments));
  CAIRN_ASSIGN_OR_RETURN(const BuildPaths paths, ResolvePaths(arguments));
  CAIRN_ASSIGN_OR_RETURN(const std::string goal, MakeGoal(arguments.until, recipe, paths));
  WarnOfUnreadKeys(recipe);
  CAIRN_ASSIGN_OR_RETURN(const std::string rules, RulesPath(paths.program));
  const std::string session = NewBuildSession();
  CAIRN_ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Acquire(paths.build_dir, session));
  CAIRN_RETURN_IF_ERROR(WriteBuildFolder(recipe, paths));
  CAIRN_RETURN_IF_ERROR(ReserveErrorFile(paths.build_dir));

  const auto dates_before = StampDates(paths.build_dir);
  const int num_jobs = arguments.num_jobs > 0 ? arguments.num_jobs : arguments.num_shards;
  // Bars of stages that run side by side would overwrite each other.
  const bool collides = num_jobs > 1 && environment.progress_style == "auto";
  const std::string memory = environment.memory_given ? std::to_string(environment.memory_mib) : "";
  MakeVariables variables;
  CAIRN_RETURN_IF_ERROR(variables.SetLauncher("LAUNCH", "--launch", arguments.launcher));
  CAIRN_RETURN_IF_ERROR(variables.Set("MEMORY", "--memory", {memory}));
  CAIRN_RETURN_IF_ERROR(
      variables.Set("SPACE_CHECK", "--no-space-check", {arguments.no_space_check ? "no" : ""}));
  CAIRN_RETURN_IF_ERROR(variables.Set("SHARDS", "--shards", {std::to_string(arguments.num_shards)}));
  CAIRN_RETURN_IF_ERROR(
      variables.Set("SHARD_IMAGES", "--shard-images", {std::to_string(arguments.min_num_shard_images)}));
  CAIRN_ASSIGN_OR_RETURN(std::vector<std::string> words,
                         MakeWords(rules, paths.build_dir, paths.program, goal, environment,
                                   collides ? "lines" : environment.progress_style, std::move(variables)));
  words.push_back("--jobs=" + std::to_string(num_jobs));
  CAIRN_ASSIGN_OR_RETURN(
      const int wait_status,
      RunProgramAndWait(words, std::string(kBuildSessionVariable) + "=" + session, *environment.progress));
  BuildRun run = {.build_dir = paths.build_dir,
                  .recipe = arguments.recipe,
                  .map = arguments.output,
                  .seed = recipe.seed,
                  .simulated = recipe.simulated,
                  .joined = recipe.captures.size() > 1,
                  .reconstructed = IsReconstructed(recipe),
                  .has_floor_plan = HasFloorPlan(recipe),
                  .leaves_out = LeavesOut(recipe),
                  .footage = FootageFolders(recipe),
                  .whole_line = goal == paths.map,
                  .ran = RanSince(dates_before, paths.build_dir)};
  if (!WIFEXITED(wait_status) || WEXITSTATUS(wait_status) != 0) run.error = StageError(paths, arguments);
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  RemoveStaleTemporaries(paths.build_dir);  // of stages that were stopped
  const Status told = TellOfRun(run, paths, *environment.out);
  if (run.error) return *run.error;
  CAIRN_RETURN_IF_ERROR(told);
  fs::remove(paths.build_dir + kErrorFile);
  *environment.out << fmt::format("{}: {}\n", goal == paths.map ? arguments.output : goal,
                                  run.ran.empty() ? "up to date" : "compiled");
  return Ok();
}

void AddRunArguments(ArgumentParser& parser, CompileArguments* arguments) {
  parser.Add("--until", arguments->until, "Stop after this stage").Type("STAGE");
  parser
      .Add("--shards", arguments->num_shards,
           "Most parts in which features and matches are made, each by a process of its own [1]")
      .Range(1, 100000)
      .Type("N");
  parser
      .Add("--shard-images", arguments->min_num_shard_images,
           "Fewest images of a part: of a small survey there are fewer parts, as what each costs to start "
           "would be more than it saves [64]")
      .Range(1, 1000000)
      .Type("M");
  parser
      .Add("--launch", arguments->launcher,
           "Words put before every stage's command, for a cluster: 'srun -n1 -c2' (docs/cluster.md)")
      .Type("WORDS");
  parser.Add("-j,--jobs", arguments->num_jobs, "Stages or shards to run side by side [as many as --shards]")
      .Range(1, 100000)
      .Type("N");
  parser.AddFlag("--no-space-check", arguments->no_space_check,
                 "Begin even if the disk seems too full for the stages' files");
}

Command CompileCommand() {
  const auto arguments = std::make_shared<CompileArguments>();
  return {
      .name = "compile",
      .summary =
          "Compile a recipe, a film, a ROS bag or the folder of a capture into a map, or redo what changed",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            AddRecipeArguments(parser, arguments.get());
            AddRunArguments(parser, arguments.get());
          },
      .run = [arguments](const CommandEnvironment& environment) { return Compile(*arguments, environment); }};
}

Command ConfigureCommand() {
  const auto arguments = std::make_shared<CompileArguments>();
  return {
      .name = "configure",
      .summary = "Split a recipe into a build folder, for Makefiles that include map.mk",
      .add_arguments = [arguments](ArgumentParser& parser) { AddRecipeArguments(parser, arguments.get()); },
      .run =
          [arguments](const CommandEnvironment& environment) { return Configure(*arguments, environment); }};
}

}  // namespace cairn::pipeline
