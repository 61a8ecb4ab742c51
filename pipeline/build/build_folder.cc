#include "pipeline/build/build_folder.h"

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/capture/bag_file.h"
#include "core/capture/capture.h"
#include "core/capture/join_captures.h"
#include "core/files/file.h"
#include "pipeline/build/make_words.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kConfigHead =
    "# Written by cairn from the recipe whose path is in the file `recipe` beside this one; edit that "
    "instead.\n";

Status CreateFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error) return Ok();
  return MakeError(ErrorCode::kIo, "{}: the folder cannot be made: {}", path, error.message());
}

std::string Absolute(const std::string& path) {
  std::string text = fs::absolute(path).lexically_normal().string();
  while (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

// Several captures are joined into one, in the build folder.
bool IsJoined(const Recipe& recipe) { return recipe.captures.size() > 1; }

// Tells programs apart without reading them, as map.mk does: bytes and seconds since 1970.
std::string SizeAndDate(const std::string& path) {
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) return "";
  return fmt::format("{}-{}", status.st_size, status.st_mtim.tv_sec);
}

// The value of an option of a stage.
std::string OptionText(const Recipe& recipe, const std::string& stage_name, const std::string& name) {
  for (const StageOptions& stage : recipe.stages) {
    if (stage.stage != stage_name) continue;
    for (const Option& option : stage.table) {
      if (option.name == name) return OptionValueText(option);
    }
  }
  return "";
}

// Files with known places of images, besides the capture's own.
Result<std::vector<std::string>> KnownPlaces(const Recipe& recipe, const std::string& capture) {
  std::vector<std::string> files;
  for (const char* name : {"control_points", "distances", "rig_baselines"}) {
    const std::string file = OptionText(recipe, "reconstruct", name);
    if (file.empty()) continue;
    if (IsJoined(recipe)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "[reconstruct] {} = \"{}\" names images of one capture, and the recipe has {}: put the images of "
          "each session into a folder of one capture, and the folders' names into its sessions.txt",
          name, file, recipe.captures.size());
    }
    const std::string path = (fs::path(capture) / file).lexically_normal().string();
    if (!fs::exists(path)) {
      return MakeError(ErrorCode::kNotFound,
                       "[reconstruct] {} = \"{}\": there is no {} (paths are relative to the capture)", name,
                       file, path);
    }
    files.push_back(path);
  }
  return files;
}

// The file of an earlier compilation that a stage takes over by this option; empty: none.
Result<std::string> EarlierFile(const Recipe& recipe, const std::string& stage, const std::string& option,
                                const BuildPaths& paths) {
  const std::string file = OptionText(recipe, stage, option);
  if (file.empty()) return file;
  const std::string path = (fs::path(paths.recipe).parent_path() / file).lexically_normal().string();
  if (!fs::exists(path)) {
    return MakeError(ErrorCode::kNotFound,
                     "[{}] {} = \"{}\": there is no {} (paths are relative to the recipe)", stage, option,
                     file, path);
  }
  return path;
}

// The map that [emit_map] is to change as little as it can; empty: none.
Result<std::string> PreviousMapPath(const Recipe& recipe, const BuildPaths& paths) {
  CAIRN_ASSIGN_OR_RETURN(const std::string path, EarlierFile(recipe, "emit_map", "previous", paths));
  std::error_code error;
  if (!path.empty() && fs::equivalent(path, paths.map, error)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "[emit_map] previous = \"{}\" is the map that is compiled, which it would replace: a later "
        "run would begin with another one; keep a copy under another name",
        path);
  }
  return path;
}

// The folder that a capture is in, or will be.
std::string FolderOf(const RecipeCapture& capture, const std::string& build_dir) {
  return capture.IsFootage() ? build_dir + "/" + FootageFolderName(capture) : Absolute(capture.path);
}

// The folder that the stages read.
std::string CaptureFolder(const Recipe& recipe, const std::string& build_dir) {
  if (recipe.simulated || IsJoined(recipe)) return build_dir + "/capture";
  return FolderOf(recipe.captures.front(), build_dir);
}

using WordPairs = std::vector<std::pair<std::string, std::string>>;

// The films and bags, by FootageFolderName: where they are, the files in which they are, and the words of
// options with which they are imported.
struct FootagePairs {
  WordPairs sources, files, options;
};

FootagePairs Footage(const Recipe& recipe) {
  FootagePairs pairs;
  for (const RecipeCapture& capture : recipe.captures) {
    if (!capture.IsFootage()) continue;
    const std::string name = FootageFolderName(capture), source = Absolute(capture.path);
    pairs.sources.emplace_back(name, source);
    for (const std::string& file : FilesOfBag(source)) pairs.files.emplace_back(name, file);
    for (const std::string& word : FootageWords(capture.kind, capture.footage))
      pairs.options.emplace_back(name, word);
  }
  return pairs;
}

// Those of `pairs` that are for this name, a line each.
std::string LinesOf(const std::string& name, const WordPairs& pairs) {
  std::string lines;
  for (const auto& [first, second] : pairs) lines += first == name ? second + "\n" : "";
  return lines;
}

// Whose odometry or IMU gives poses their scale, and what of it: a line for each capture that may have some.
std::string OdometryLines(const Recipe& recipe) {
  std::string lines;
  for (const RecipeCapture& capture : recipe.captures) {
    const FootageOptions& options = capture.footage;
    if (capture.kind == CaptureKind::kBag) {
      lines += fmt::format("{}: {} {} {}\n", capture.name, options.odometry, options.camera_on_robot,
                           options.max_time_gap_s);
      if (!options.imu.empty() || !options.imu_on_camera.empty())
        lines += fmt::format("{}: imu {} {}\n", capture.name, options.imu, options.imu_on_camera);
    } else {
      if (fs::exists(capture.path + "/" + kOdometryFile)) lines += capture.name + "\n";
      if (fs::exists(capture.path + "/" + kImuFile)) lines += capture.name + ": imu\n";
    }
  }
  return lines;
}

// What a joined capture is made of: NAME=FOLDER, and NAME=FILE where the recipe gives queries.
struct SessionWords {
  WordPairs folders, queries;
  std::vector<std::string> registered;  // names of those that the recipe says are in a frame of their own
};

SessionWords JoinedSessions(const Recipe& recipe, const std::string& build_dir) {
  SessionWords words;
  if (!IsJoined(recipe)) return words;
  for (const RecipeCapture& capture : recipe.captures) {
    words.folders.emplace_back(capture.name, FolderOf(capture, build_dir));
    if (!capture.queries_path.empty())
      words.queries.emplace_back(capture.name, Absolute(capture.queries_path));
    if (capture.is_registered) words.registered.push_back(capture.name);
  }
  return words;
}

std::string PairsLine(const WordPairs& pairs) {
  std::string line;
  for (const auto& [first, second] : pairs)
    line += fmt::format("{}{}={}", line.empty() ? "" : " ", first, second);
  return line + "\n";
}

// Where none is registered by the recipe, nothing: build folders of before stay valid.
std::string RegisteredLine(const SessionWords& sessions) {
  return sessions.registered.empty() ? ""
                                     : fmt::format("registered {}\n", fmt::join(sessions.registered, " "));
}

// Whether a list of images has a line that is none of its comments.  What is there and no file is not read: a
// pipe would block.
bool HasLines(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return fs::exists(path, error);
  std::ifstream list(path);
  for (std::string line; std::getline(list, line);) {
    const size_t first = line.find_first_not_of(" \t\r");
    if (first != std::string::npos && line[first] != '#') return true;
  }
  return false;
}

// Which captures of a joined one are registered to the others.
Result<std::vector<bool>> RegisteredCaptures(const Recipe& recipe) {
  std::vector<CaptureSession> sessions;
  for (const RecipeCapture& capture : recipe.captures)
    sessions.push_back({.name = capture.name,
                        .root = capture.path,
                        .queries_path = capture.queries_path,
                        .is_registered = capture.is_registered});
  return SessionsToRegister(sessions);
}

// The held-out images that check_map localizes; empty = none are given.
std::string QueriesPath(const Recipe& recipe, const std::string& capture, const std::string& build_dir) {
  const auto has_queries = [](const RecipeCapture& c) {
    return !c.queries_path.empty() || HasLines(c.path + "/queries.txt");
  };
  if (!recipe.simulated && !IsJoined(recipe) && !recipe.captures.front().queries_path.empty())
    return Absolute(recipe.captures.front().queries_path);
  // Those of captures with poses are kept where others are registered to them, whose own are not.
  const Result<std::vector<bool>> are_registered = RegisteredCaptures(recipe);
  bool is_any = false;
  for (size_t i = 0; i < recipe.captures.size(); ++i)
    is_any |= has_queries(recipe.captures[i]) && !(are_registered.ok() && (*are_registered)[i]);
  if (IsReconstructed(recipe)) {
    const bool holds_out = OptionText(recipe, "reconstruct", "hold_out_every") != "0";
    return holds_out || is_any ? build_dir + "/poses/queries.txt" : "";
  }
  const bool are_rendered = recipe.simulated && OptionText(recipe, "simulate", "num_queries") != "0";
  return are_rendered || is_any ? capture + "/queries.txt" : "";
}

// The floor plan of the place; empty = none.
std::string FloorPlanPath(const Recipe& recipe, const std::string& capture) {
  if (!recipe.simulated_floor_plan.empty()) return capture + "/" + recipe.simulated_floor_plan;
  for (const RecipeCapture& given : recipe.captures) {
    if (!given.floor_plan_path.empty()) return Absolute(given.floor_plan_path);
  }
  return "";
}

}  // namespace

std::string FootageFolderName(const RecipeCapture& capture) {
  return (capture.kind == CaptureKind::kBag ? "bag-" : "film-") + capture.name;
}

bool HasFloorPlan(const Recipe& recipe) { return !FloorPlanPath(recipe, "").empty(); }

bool IsReconstructed(const Recipe& recipe) {
  if (recipe.simulated) return false;
  const std::string& path = recipe.captures.front().path;
  if (!IsJoined(recipe)) return !fs::exists(path + "/images.txt") || fs::exists(path + "/" + kRegisterFile);
  const Result<bool> is_registered = IsRegistered(recipe);
  return !fs::exists(path + "/images.txt") || !is_registered.ok() || *is_registered;
}

Result<bool> IsRegistered(const Recipe& recipe) {
  if (recipe.simulated) return false;
  if (!IsJoined(recipe)) {
    const std::string& path = recipe.captures.front().path;
    return fs::exists(path + "/images.txt") && fs::exists(path + "/" + kRegisterFile);
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<bool> are_registered, RegisteredCaptures(recipe));
  return std::find(are_registered.begin(), are_registered.end(), true) != are_registered.end();
}

bool HasQueries(const Recipe& recipe) { return !QueriesPath(recipe, "", "").empty(); }

bool LeavesOut(const Recipe& recipe) {
  return !HasQueries(recipe) && OptionText(recipe, "leave_out", "hold_out") != "0";
}

Status WriteBuildFolder(const Recipe& recipe, const BuildPaths& paths) {
  CAIRN_ASSIGN_OR_RETURN(const bool is_registered, IsRegistered(recipe));
  const std::string capture = CaptureFolder(recipe, paths.build_dir);
  const std::string queries = QueriesPath(recipe, capture, paths.build_dir);
  const std::string floor_plan = FloorPlanPath(recipe, capture);
  const SessionWords sessions = JoinedSessions(recipe, paths.build_dir);
  const FootagePairs footage = Footage(recipe);
  const std::string seed = std::to_string(recipe.seed);
  std::vector<std::string> known_places;
  if (IsReconstructed(recipe)) {
    CAIRN_ASSIGN_OR_RETURN(known_places, KnownPlaces(recipe, capture));
  }
  CAIRN_ASSIGN_OR_RETURN(const std::string tree, EarlierFile(recipe, "build_vocabulary", "tree_from", paths));
  CAIRN_ASSIGN_OR_RETURN(const std::string previous_map, PreviousMapPath(recipe, paths));
  CAIRN_ASSIGN_OR_RETURN(const std::string model, EarlierFile(recipe, "extract_features", "model", paths));
  // Before anything is written, names that make cannot read are refused.
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the build folder", paths.build_dir));
  CAIRN_RETURN_IF_ERROR(CheckMakePath("the program", paths.program));
  MakeVariables config;
  CAIRN_RETURN_IF_ERROR(config.Set("MAP", "the map", {paths.map}));
  CAIRN_RETURN_IF_ERROR(config.Set("CAPTURE", "the capture", {capture}));
  CAIRN_RETURN_IF_ERROR(config.Set("SIMULATED", "", {recipe.simulated ? "yes" : "no"}));
  CAIRN_RETURN_IF_ERROR(config.Set("RECONSTRUCTED", "", {IsReconstructed(recipe) ? "yes" : "no"}));
  CAIRN_RETURN_IF_ERROR(config.Set("REGISTERED", "", {is_registered ? "yes" : "no"}));
  CAIRN_RETURN_IF_ERROR(
      config.Set("KNOWN_PLACES", "[reconstruct] control_points, distances or rig_baselines", known_places));
  CAIRN_RETURN_IF_ERROR(config.Set("QUERIES", "the list of queries", {queries}));
  CAIRN_RETURN_IF_ERROR(config.Set("LEFT_OUT", "", {LeavesOut(recipe) ? "yes" : "no"}));
  CAIRN_RETURN_IF_ERROR(config.Set("NAME", "the name", {recipe.name}));
  CAIRN_RETURN_IF_ERROR(config.Set("SEED", "the seed", {seed}));
  CAIRN_RETURN_IF_ERROR(config.Set("PROGRAM", "the program", {SizeAndDate(paths.program)}));
  CAIRN_RETURN_IF_ERROR(config.SetPairs("FOOTAGE", "the film or bag", footage.sources));
  CAIRN_RETURN_IF_ERROR(config.SetPairs("FOOTAGE_FILES", "the file of a film or bag", footage.files));
  CAIRN_RETURN_IF_ERROR(config.SetPairs("FOOTAGE_OPTIONS", "the option of a film or bag", footage.options));
  CAIRN_RETURN_IF_ERROR(config.SetPairs("SESSIONS", "the capture", sessions.folders));
  CAIRN_RETURN_IF_ERROR(config.SetPairs("SESSION_QUERIES", "the list of queries", sessions.queries));
  CAIRN_RETURN_IF_ERROR(config.Set("SESSIONS_REGISTERED", "", sessions.registered));
  CAIRN_RETURN_IF_ERROR(config.Set("FLOOR_PLAN", "the floor plan", {floor_plan}));
  CAIRN_RETURN_IF_ERROR(config.Set("FLOOR_PLAN_FILES", "the image of the floor plan",
                                   decompose_views::OtherFilesOfPlan(floor_plan)));
  CAIRN_RETURN_IF_ERROR(config.Set("VOCABULARY_TREE", "[build_vocabulary] tree_from", {tree}));
  CAIRN_RETURN_IF_ERROR(config.Set("PREVIOUS_MAP", "[emit_map] previous", {previous_map}));
  CAIRN_RETURN_IF_ERROR(config.Set("MODEL", "[extract_features] model", {model}));
  if (IsReconstructed(recipe) && !is_registered && !recipe.captures.front().queries_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "queries = \"{}\": held-out images are given with their poses, but {} has none (no "
                     "images.txt); leave it out: [reconstruct] hold_out_every holds images out",
                     recipe.captures.front().queries_path, recipe.captures.front().path);
  }

  const std::string options = paths.build_dir + "/options";
  if (std::error_code error; fs::is_symlink(options, error))
    return MakeError(ErrorCode::kInvalidArgument, "{}: is a link, and cairn writes files there; remove it",
                     options);
  CAIRN_RETURN_IF_ERROR(CreateFolder(options));
  for (const StageOptions& stage : recipe.stages) {
    CAIRN_RETURN_IF_ERROR(
        WriteFileAtomically(options + "/" + stage.stage + ".toml", OptionsToml(stage.table)));
  }
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/seed", seed + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/name", recipe.name + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
      options + "/capture",
      IsJoined(recipe) ? PairsLine(sessions.folders) + PairsLine(sessions.queries) + RegisteredLine(sessions)
                       : capture + "\n"));
  for (const auto& [name, source] : footage.sources) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(
        options + "/" + name,
        LinesOf(name, footage.sources) + LinesOf(name, footage.files) + LinesOf(name, footage.options)));
  }
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/odometry", OdometryLines(recipe)));
  CAIRN_RETURN_IF_ERROR(
      WriteFileAtomically(options + "/queries", (LeavesOut(recipe) ? "left_out" : queries) + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/floor_plan", floor_plan + "\n"));
  CAIRN_ASSIGN_OR_RETURN(const std::string program_hash, HashFile(paths.program));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(options + "/program", program_hash + "\n"));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(paths.build_dir + "/recipe", paths.recipe + "\n"));
  return WriteFileAtomically(paths.build_dir + "/config.mk", kConfigHead + config.MakefileText());
}

std::string ConfiguredMap(const std::string& build_dir) {
  static constexpr std::string_view kBefore = "\nMAP := ";
  const auto config = ReadFile(build_dir + "/config.mk");
  const size_t found = config.ok() ? config->find(kBefore) : std::string::npos;
  if (found == std::string::npos) return "";
  const size_t begin = found + kBefore.size();
  return config->substr(begin, config->find('\n', begin) - begin);
}

std::string ConfiguredRecipe(const std::string& build_dir) {
  const auto recipe = ReadFile(build_dir + "/recipe");
  return recipe.ok() && recipe->ends_with('\n') ? recipe->substr(0, recipe->size() - 1) : "";
}

}  // namespace cairn::pipeline
