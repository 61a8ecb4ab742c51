#include "stages/emit_map/command.h"

#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/database.h"
#include "core/dropped_items.h"
#include "core/file.h"
#include "core/sessions.h"
#include "core/sift.h"
#include "core/views_database.h"
#include "stages/emit_map/count_drops.h"
#include "stages/emit_map/emit_map.h"
#include "stages/emit_map/learn_visual_errors.h"
#include "stages/emit_map/model_landmarks.h"

namespace cairn {
namespace {

struct Arguments {
  std::string matches_path;
  std::string classes_path;
  std::string world_path;
  std::string regions_path;
  std::string vocabulary_path;
  std::string appearance_path;
  std::string views_path;
  std::string frame_path;
  std::string sessions_path;
  std::string name;
  std::vector<std::string> stage_options;  // "STAGE=FILE.toml"
  std::string output_path;
  EmitMapOptions options;
  OptionArguments option_arguments;
};

// Images that extract-features rejected: a table of its own in features.db and what is made from it.
Result<int64_t> CountRejects(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<int64_t> {
    if (!HasTable(database, "cairn_rejects")) return int64_t{0};
    return database.execAndGet("SELECT count(*) FROM cairn_rejects").getInt64();
  });
}

Status AddProvenance(const Arguments& arguments, uint64_t seed, MapRows* rows) {
  rows->name = arguments.name;
  rows->writer = "cairn " CAIRN_VERSION;
  rows->instruction_set = SiftInstructionSet();
  rows->seed = seed;
  for (const auto& [name, path] :
       {std::pair("classes.db", arguments.classes_path), std::pair("world.db", arguments.world_path),
        std::pair("regions.db", arguments.regions_path),
        std::pair("vocabulary.db", arguments.vocabulary_path)}) {
    CAIRN_ASSIGN_OR_RETURN(rows->input_hashes[name], HashFile(path));
  }
  if (!arguments.appearance_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(rows->input_hashes["appearance.db"], HashFile(arguments.appearance_path));
  }
  if (!arguments.views_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(rows->input_hashes["views.db"], HashFile(arguments.views_path));
  }
  for (const std::string& text : arguments.stage_options) {
    const size_t equals = text.find('=');
    if (equals == 0 || equals == std::string::npos) {
      return MakeError(ErrorCode::kInvalidArgument, "--stage-options {}: expected STAGE=FILE.toml", text);
    }
    CAIRN_ASSIGN_OR_RETURN(rows->stage_options[text.substr(0, equals)], ReadFile(text.substr(equals + 1)));
  }
  EmitMapOptions options = arguments.options;
  rows->stage_options["emit_map"] = OptionsToml(DescribeOptions(&options));
  return Ok();
}

// What all stages before have dropped.  Images that were not read have no image_id: the total says it all.
Result<std::vector<DroppedItem>> ReadAllDropped(const Arguments& arguments) {
  std::vector<DroppedItem> all;
  const auto add = [&](const std::string& path, const char* table) -> Status {
    if (path.empty() || !IsSqliteFile(path)) return Ok();
    CAIRN_ASSIGN_OR_RETURN(std::vector<DroppedItem> items, ReadDroppedItems(path, table));
    std::move(items.begin(), items.end(), std::back_inserter(all));
    return Ok();
  };
  CAIRN_RETURN_IF_ERROR(add(arguments.matches_path, kColmapDroppedItemsTable));
  for (const std::string& path : {arguments.classes_path, arguments.world_path, arguments.regions_path})
    CAIRN_RETURN_IF_ERROR(add(path, kDroppedItemsTable));
  if (arguments.matches_path.empty()) return all;
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_rejects, CountRejects(arguments.matches_path));
  all.insert(all.end(), num_rejects, {.reason = DropReason::kUnreadable});
  return all;
}

Status AddDrops(const Arguments& arguments, const Classes& classes, const World& world, MapRows* rows) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<DroppedItem> dropped, ReadAllDropped(arguments));
  CAIRN_ASSIGN_OR_RETURN(rows->findings.drops, CountDrops(classes, world, dropped));
  for (const DroppedItem& item : dropped) {
    if (DescribeDropReason(item.reason).kind == DropKind::kStation)
      rows->stations[item.item_id].is_covered = false;
  }
  return Ok();
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.classes_path));
  CAIRN_ASSIGN_OR_RETURN(const World world, ReadWorld(arguments.world_path));
  CAIRN_ASSIGN_OR_RETURN(const Decomposition decomposition, ReadDecomposition(arguments.regions_path));
  CAIRN_ASSIGN_OR_RETURN(const Vocabulary vocabulary, ReadVocabulary(arguments.vocabulary_path));
  std::optional<Appearance> appearance;
  if (!arguments.appearance_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(appearance, ReadAppearance(arguments.appearance_path));
  }
  CAIRN_ASSIGN_OR_RETURN(MapRows rows, EmitMap(classes, world, decomposition, vocabulary, arguments.options,
                                               appearance ? &*appearance : nullptr));
  if (!arguments.frame_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(rows.frame, ReadCaptureFrame(arguments.frame_path));
  }
  if (!arguments.sessions_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(rows.sessions, ReadSessionsText(arguments.sessions_path));
  }
  if (arguments.options.visual_map) {
    CAIRN_ASSIGN_OR_RETURN(rows.visual_map,
                           ModelLandmarks(classes, rows, arguments.options, environment.num_threads));
    CAIRN_ASSIGN_OR_RETURN(rows.visual_map.errors,
                           LearnVisualErrors(classes, rows, rows.visual_map, environment.num_threads));
  }
  CAIRN_RETURN_IF_ERROR(AddDrops(arguments, classes, world, &rows));
  CAIRN_RETURN_IF_ERROR(AddProvenance(arguments, environment.seed, &rows));
  if (!arguments.views_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(Views views, ReadViews(arguments.views_path));
    CAIRN_RETURN_IF_ERROR(AddViews(std::move(views), &rows));
  }
  CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, arguments.output_path));
  environment.report->in = {{"classes", static_cast<int64_t>(classes.classes.size())}};
  environment.report->out = {
      {"landmarks", static_cast<int64_t>(rows.landmarks.size())},
      {"regions", static_cast<int64_t>(rows.regions.size())},
      {"bytes", static_cast<int64_t>(std::filesystem::file_size(arguments.output_path))}};
  *environment.out << fmt::format(
      "emit_map: {} landmarks of {} classes in {} regions, {} images, {} words, {:.2f} MB\n",
      rows.landmarks.size(), classes.classes.size(), rows.regions.size(), rows.images.size(),
      rows.vocabulary.num_words(),
      static_cast<double>(std::filesystem::file_size(arguments.output_path)) / 1e6);
  return Ok();
}

}  // namespace

Command EmitMapCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "emit-map",
      .summary = "Puts landmarks, regions and vocabulary together into a map",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("--matches", arguments->matches_path,
                           "matches.db, to count which images and pairs were dropped [not counted]");
            app.add_option("--classes", arguments->classes_path, "classes.db")->required();
            app.add_option("--world", arguments->world_path, "world.db")->required();
            app.add_option("--regions", arguments->regions_path, "regions.db")->required();
            app.add_option("--vocabulary", arguments->vocabulary_path, "vocabulary.db")->required();
            app.add_option("--appearance", arguments->appearance_path,
                           "appearance.db: which images see the same, and which are kept [not in the map]");
            app.add_option("--views", arguments->views_path,
                           "views.db: the floor plan and its view-invariant regions [not in the map]");
            app.add_option("--frame", arguments->frame_path,
                           "frame.json of the poses: unit and place on the Earth [metres, anywhere]");
            app.add_option("--sessions", arguments->sessions_path,
                           "sessions.txt of the capture: image SESSION/NAME is of that survey [one survey]");
            app.add_option("--name", arguments->name, "name of the map")->required();
            app.add_option("--stage-options", arguments->stage_options,
                           "STAGE=FILE.toml, once per stage: options to note in the map");
            app.add_option("-o,--output", arguments->output_path, "map to write, not yet sealed")->required();
            arguments->option_arguments.Add(app, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
  };
}

}  // namespace cairn
