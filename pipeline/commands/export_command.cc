#include "pipeline/commands/commands.h"

#include <memory>

#include "core/colmap/colmap_database.h"
#include "core/files/folder.h"
#include "pipeline/exchange/export/colmap_export.h"

namespace cairn::pipeline {
namespace {

constexpr int kClassesApplicationId = 0x6372636c;  // 'crcl', schemas/classes.sql

struct ExportArguments {
  std::string input;
  std::string output;
  std::string matches;
  bool text = false;
  bool binary = false;
};

Result<bool> HoldsClasses(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<bool> {
    return database.execAndGet("PRAGMA application_id").getInt() == kClassesApplicationId;
  });
}

Result<ImageKeypoints> ReadKeypoints(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(path));
  return WithDatabaseErrors(path, [&]() -> Result<ImageKeypoints> {
    ImageKeypoints keypoints;
    CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
    for (const DatabaseImage& image : images) {
      CAIRN_ASSIGN_OR_RETURN(keypoints[image.image_id], ReadDatabaseKeypoints(database, image.image_id));
    }
    return keypoints;
  });
}

Result<ColmapModel> ReadModel(const ExportArguments& arguments) {
  CAIRN_ASSIGN_OR_RETURN(const bool holds_classes, HoldsClasses(arguments.input));
  if (!holds_classes) {
    if (!arguments.matches.empty())
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: not a classes.db, which --matches is for; leave --matches out", arguments.input);
    CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(arguments.input));
    return ModelFromMap(rows);
  }
  CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(arguments.input));
  std::optional<ImageKeypoints> keypoints;
  if (!arguments.matches.empty()) {
    CAIRN_ASSIGN_OR_RETURN(keypoints, ReadKeypoints(arguments.matches));
  }
  auto model = ModelFromClasses(classes, keypoints ? &*keypoints : nullptr);
  if (!model.ok()) return MakeError(model.error().code, "{}: {}", arguments.input, model.error().message);
  return model;
}

Status RunExport(const ExportArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const ColmapModel model, ReadModel(arguments));
  const ModelFormat format = arguments.text ? ModelFormat::kText : ModelFormat::kBinary;
  CAIRN_RETURN_IF_ERROR(ReplaceFolderAtomically(
      arguments.output, "a COLMAP model",
      [&](const std::string& folder) { return WriteColmapModel(model, format, folder); }));
  size_t num_observations = 0;
  for (const ModelPoint& point : model.points) num_observations += point.track.size();
  *environment.out << fmt::format("export: {} cameras, {} images, {} points, {} observations\n",
                                  model.cameras.size(), model.images.size(), model.points.size(),
                                  num_observations);
  return Ok();
}

}  // namespace

Command ExportCommand() {
  auto arguments = std::make_shared<ExportArguments>();
  return {
      .name = "export",
      .summary = "Write a map, or a survey's feature classes, as a COLMAP model",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("input", arguments->input, "Map, or classes.db for full tracks")
                .Required()
                .Type("MAP|classes.db");
            parser.Add("-o,--output", arguments->output, "Model folder to write").Required().Type("FOLDER");
            parser
                .Add("--matches", arguments->matches,
                     "classes.db only: database whose keypoints the model lists, with their numbers [only "
                     "keypoints in tracks]")
                .Type("matches.db");
            const Argument text = parser.AddFlag("--text", arguments->text, "Write .txt files");
            parser.AddFlag("--binary", arguments->binary, "Write .bin files (the default)").Excludes(text);
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunExport(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
