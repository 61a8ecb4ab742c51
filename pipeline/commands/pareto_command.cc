#include "pipeline/commands/commands.h"

#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <toml++/toml.h>
#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/blocks/map_rows.h"
#include "core/files/file.h"
#include "core/modules/program_files.h"
#include "core/options/toml_options.h"
#include "pipeline/build/build_step.h"
#include "pipeline/build/folder_lock.h"
#include "pipeline/build/recipe.h"
#include "pipeline/build/recipe_source.h"
#include "pipeline/build/run_make.h"
#include "pipeline/program/stop_signal.h"
#include "pipeline/report/pareto_picture.h"
#include "stages/emit_map/choose/fit_size.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// By default each map has half the bytes of the one before, until a map is not possible.
constexpr int kMaxNumHalvings = 12;
// Then sizes between the last one possible and the first one that was not.
constexpr int kNumBetween = 2;

struct ParetoArguments {
  std::string recipe;
  std::string output;
  std::string build_dir;
  std::optional<std::string> sizes;  // "100000,50000"; none: halves
  std::string peer;                  // "NAME,BYTES,LOCALIZED_RATIO,MEDIAN_ERROR_M"
};

struct Places {
  std::string map;        // NAME.cairn
  std::string build_dir;  // NAME.build
  std::string program, rules;
  std::string Pareto(int64_t size, const char* suffix) const {
    return fmt::format("{}/pareto/{}{}", build_dir, size, suffix);
  }
};

Result<std::vector<int64_t>> ParseSizes(const std::string& text) {
  std::vector<int64_t> sizes;
  for (const std::string& field : SplitFields(text, ',')) {
    int64_t size = 0;
    if (!ParseNumber(field, &size) || size <= 0 || size > INT32_MAX) {
      return MakeError(ErrorCode::kInvalidArgument, "--sizes {}: '{}' is not a number of bytes from 1 to {}",
                       text, field, INT32_MAX);
    }
    sizes.push_back(size);
  }
  std::sort(sizes.rbegin(), sizes.rend());
  sizes.erase(std::unique(sizes.begin(), sizes.end()), sizes.end());
  return sizes;
}

Result<std::optional<ParetoPeer>> ParsePeer(const std::string& text) {
  if (text.empty()) return std::optional<ParetoPeer>();
  const std::vector<std::string> fields = SplitFields(text, ',');
  ParetoPeer peer;
  if (fields.size() != 4 || !ParseNumber(fields[1], &peer.num_bytes) ||
      !ParseNumber(fields[2], &peer.localized_ratio) || !ParseNumber(fields[3], &peer.median_error_m) ||
      !(peer.num_bytes >= 1 && peer.localized_ratio >= 0 && peer.localized_ratio <= 1 &&
        peer.median_error_m > 0)) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--peer {}: expected NAME,BYTES,LOCALIZED_RATIO,MEDIAN_ERROR_M, as in COLMAP,70100000,0.98,0.059",
        text);
  }
  peer.name = fields[0];
  return std::optional<ParetoPeer>(std::move(peer));
}

// Runs this program or make; its exit code.
Result<int> ExitCode(const std::vector<std::string>& words, const std::string& session,
                     const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(
      const int wait_status,
      RunProgramAndWait(words, std::string(kBuildSessionVariable) + "=" + session, *environment.progress));
  if (environment.progress->Cancelled())
    return MakeError(ErrorCode::kCancelled, "stopped; the same command goes on where it was");
  return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : static_cast<int>(ErrorCode::kFailed);
}

Status CompileMap(const ParetoArguments& arguments, const Places& places,
                  const CommandEnvironment& environment) {
  std::vector<std::string> words = {places.program,
                                    "compile",
                                    arguments.recipe,
                                    "-o",
                                    places.map,
                                    "--build-dir",
                                    places.build_dir,
                                    "--threads",
                                    std::to_string(environment.num_threads),
                                    "--progress",
                                    environment.progress_style,
                                    "--log-level",
                                    environment.log_level};
  if (environment.seed_given) {
    words.insert(words.end(), {"--seed", std::to_string(environment.seed)});
  }
  if (environment.memory_given) {
    words.insert(words.end(), {"--memory", std::to_string(environment.memory_mib)});
  }
  CAIRN_ASSIGN_OR_RETURN(const int exit_code, ExitCode(words, "", environment));
  if (exit_code == 0) return Ok();
  return MakeError(static_cast<ErrorCode>(exit_code), "{}: the map itself was not compiled",
                   arguments.recipe);
}

// The point of an existing map.
Result<ParetoPoint> ReadPoint(const Places& places, int64_t size) {
  const std::string path = places.Pareto(size, ".json");
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded() || !json.contains("num_held_out")) {
    return MakeError(ErrorCode::kNoData, "{}: no held-out images; pareto needs a capture with queries.txt",
                     path);
  }
  const std::string map = places.Pareto(size, ".cairn");
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(map));
  const emit_map::SizeGuarantee guarantee = emit_map::GuaranteeOf(rows);
  ParetoPoint point{.max_bytes = size,
                    .num_bytes = static_cast<int64_t>(fs::file_size(map)),
                    .num_landmarks = std::ssize(rows.landmarks),
                    .min_common_landmarks = guarantee.min_common_landmarks,
                    .num_stations_below_k = guarantee.num_stations_below_k,
                    .num_held_out = json["num_held_out"].get<int>(),
                    .localized_ratio = json["localized_ratio"].get<double>(),
                    .within_10cm_5deg_ratio = json["within_10cm_5deg_ratio"].get<double>()};
  if (const auto options = rows.stage_options.find("emit_map"); options != rows.stage_options.end()) {
    CAIRN_ASSIGN_OR_RETURN(const toml::table keys, ParseToml(options->second, map));
    point.descriptor_bits = keys["descriptor_bits"].value_or(0);
  }
  if (json.contains("precision_ratio")) point.precision_ratio = json["precision_ratio"].get<double>();
  if (json.contains("median_error_m")) {
    point.median_error_m = json["median_error_m"].get<double>();
    point.median_error_deg = json["median_error_deg"].get<double>();
  }
  return point;
}

// Nothing where no map of so few bytes is possible; the stage has said so.
Result<std::optional<ParetoPoint>> MakePoint(const Places& places, int64_t size,
                                             const CommandEnvironment& environment) {
  MakeVariables variables;
  const std::string memory = environment.memory_given ? std::to_string(environment.memory_mib) : "";
  CAIRN_RETURN_IF_ERROR(variables.Set("MEMORY", "--memory", {memory}));
  CAIRN_ASSIGN_OR_RETURN(
      const std::vector<std::string> words,
      MakeWords(places.rules, places.build_dir, places.program, places.Pareto(size, ".json"), environment,
                environment.progress_style, std::move(variables)));
  fs::remove(places.build_dir + "/pareto" + kErrorFile);
  CAIRN_ASSIGN_OR_RETURN(const int exit_code, ExitCode(words, NewBuildSession(), environment));
  if (exit_code != 0) {
    const std::optional<StageFailure> failure = ReadErrorFile(places.build_dir + "/pareto");
    if (failure && failure->stage == "emit-map" &&
        failure->message.find(emit_map::kLeastPossible) != std::string::npos)
      return std::optional<ParetoPoint>();
    return MakeError(failure ? failure->code : ErrorCode::kFailed, "the map of at most {} bytes was not made",
                     size);
  }
  CAIRN_ASSIGN_OR_RETURN(ParetoPoint point, ReadPoint(places, size));
  return std::optional<ParetoPoint>(std::move(point));
}

// Two significant digits are enough for a limit.
int64_t Rounded(double size) {
  const double unit = std::pow(10, std::floor(std::log10(size)) - 1);
  return static_cast<int64_t>(std::floor(size / unit) * unit);
}

// Halves the map of all classes again and again while a map is possible; then sizes between.
Status AddHalves(int64_t num_bytes, const std::function<Result<bool>(int64_t)>& add) {
  auto possible = static_cast<double>(num_bytes);
  for (int i = 0; i < kMaxNumHalvings; ++i) {
    CAIRN_ASSIGN_OR_RETURN(const bool added, add(Rounded(possible / 2)));
    if (added) {
      possible /= 2;
      continue;
    }
    double impossible = possible / 2;
    for (int k = 0; k < kNumBetween; ++k) {
      const double between = std::sqrt(possible * impossible);
      CAIRN_ASSIGN_OR_RETURN(const bool is_possible, add(Rounded(between)));
      (is_possible ? possible : impossible) = between;
    }
    break;
  }
  return Ok();
}

Status RunPareto(ParetoArguments arguments, const CommandEnvironment& environment) {
  LiftStopDeadline();
  CAIRN_ASSIGN_OR_RETURN(const std::vector<int64_t> asked,
                         !arguments.sizes ? std::vector<int64_t>() : ParseSizes(*arguments.sizes));
  CAIRN_ASSIGN_OR_RETURN(const std::optional<ParetoPeer> peer, ParsePeer(arguments.peer));
  CAIRN_ASSIGN_OR_RETURN(const RecipeSource source, FindRecipe(arguments.recipe, arguments.output));
  if (source.was_written)
    *environment.out << fmt::format("{}: the recipe of {}, with defaults\n", source.recipe, arguments.recipe);
  arguments.recipe = source.recipe;
  if (source.map.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipe(source.recipe, AllStageOptions()));
    arguments.output = recipe.name + ".cairn";
  } else {
    arguments.output = source.map;
  }
  Places places;
  places.map = fs::absolute(arguments.output).lexically_normal().string();
  places.build_dir = arguments.build_dir.empty()
                         ? fs::path(places.map).replace_extension(".build").string()
                         : fs::absolute(arguments.build_dir).lexically_normal().string();
  CAIRN_ASSIGN_OR_RETURN(places.program, ProgramPath());
  CAIRN_ASSIGN_OR_RETURN(places.rules, RulesPath(places.program));
  CAIRN_RETURN_IF_ERROR(CompileMap(arguments, places, environment));
  fs::create_directories(places.build_dir + "/pareto");

  std::vector<ParetoPoint> points;
  const auto add = [&](int64_t size) -> Result<bool> {
    CAIRN_ASSIGN_OR_RETURN(const std::optional<ParetoPoint> point, MakePoint(places, size, environment));
    if (point) points.push_back(*point);
    return point.has_value();
  };
  CAIRN_RETURN_IF_ERROR(add(0));
  for (const int64_t size : asked) CAIRN_RETURN_IF_ERROR(add(size));
  if (!arguments.sizes) CAIRN_RETURN_IF_ERROR(AddHalves(points[0].num_bytes, add));
  const std::string csv = fs::path(places.map).replace_extension(".pareto.csv").string();
  const std::string svg = fs::path(places.map).replace_extension(".pareto.svg").string();
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(csv, ParetoCsv(points)));
  CAIRN_RETURN_IF_ERROR(
      WriteFileAtomically(svg, ParetoSvg(fs::path(places.map).stem().string(), points, peer)));
  *environment.out << ParetoText(points)
                   << fmt::format("{}\n{}\nmaps: {}/pareto/*.cairn\n", csv, svg, places.build_dir);
  return Ok();
}

}  // namespace

Command ParetoCommand() {
  auto arguments = std::make_shared<ParetoArguments>();
  return {
      .name = "pareto",
      .summary = "Compile a recipe in several sizes and show what a smaller map costs",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser
                .Add("recipe", arguments->recipe,
                     "Recipe of the map, or the folder of a capture; it needs held-out images")
                .Required()
                .Type("RECIPE.toml|FOLDER");
            parser
                .Add("-o,--output", arguments->output,
                     "Map to compile; NAME.pareto.csv and NAME.pareto.svg are written beside it [by the "
                     "name of the recipe or the folder, in the current folder]")
                .Type("NAME.cairn");
            parser
                .Add("--build-dir", arguments->build_dir,
                     "Folder for the stages' files [NAME.build beside the map]")
                .Type("FOLDER");
            parser
                .Add("--sizes", arguments->sizes,
                     "Sizes to try, bytes [the map of all classes, halved while a map is possible]")
                .Type("BYTES,...");
            parser
                .Add(
                    "--peer", arguments->peer,
                    "Another program's map to show in the picture: NAME,BYTES,LOCALIZED_RATIO,MEDIAN_ERROR_M")
                .Type("PEER");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunPareto(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
