#include "pipeline/commands/commands.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "core/files/file.h"
#include "core/map/map_delta.h"
#include "core/map/map_file.h"
#include "pipeline/commands/epoch_argument.h"
#include "pipeline/explain/compare_maps.h"
#include "runtime/map/update_map.h"

namespace cairn::pipeline {
namespace {

struct Arguments {
  std::string old_path;
  std::string new_path;
  std::string delta_path;
  std::string key_path;
  std::string name;
  uint64_t min_epoch = 0;
  bool allow_older = false;
  bool in_place = false;
};

// Blocks of a map that the other one has too.
size_t NumSharedBlocks(const MapFile& map, const MapFile& other) {
  std::set<Hash> hashes;
  for (const BlockEntry& entry : other.directory().blocks()) hashes.insert(entry.hash);
  return std::count_if(map.directory().blocks().begin(), map.directory().blocks().end(),
                       [&](const BlockEntry& entry) { return hashes.contains(entry.hash); });
}

Status MakeDelta(const Arguments& arguments, const CommandEnvironment& environment) {
  std::optional<SecretKey> key;
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(key, ReadSecretKey(arguments.key_path));
  }
  CAIRN_ASSIGN_OR_RETURN(const MapDelta delta,
                         MakeMapDelta(arguments.old_path, arguments.new_path, key, arguments.allow_older));
  const std::string bytes = EncodeMapDelta(delta);
  CAIRN_ASSIGN_OR_RETURN(const MapFile old_map, MapFile::Open(arguments.old_path, {}));
  CAIRN_ASSIGN_OR_RETURN(const MapFile new_map, MapFile::Open(arguments.new_path, {}));
  CAIRN_ASSIGN_OR_RETURN(const MapRows old_rows, ReadMapRows(old_map));
  CAIRN_ASSIGN_OR_RETURN(const MapRows new_rows, ReadMapRows(new_map));
  const size_t num_blocks = new_map.directory().blocks().size();
  const std::string told =
      fmt::format("{}: {} bytes, {:.2f} % of {}'s {}; {} of {} regions and {} of {} blocks differ{}\n",
                  arguments.delta_path, bytes.size(),
                  100.0 * static_cast<double>(bytes.size()) / static_cast<double>(delta.new_num_bytes),
                  arguments.new_path, delta.new_num_bytes, NumChangedRegions(CompareMaps(old_rows, new_rows)),
                  new_rows.regions.size(), num_blocks - NumSharedBlocks(new_map, old_map), num_blocks,
                  delta.is_signed() ? "" : "; not signed");
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.delta_path, bytes));
  *environment.out << told;
  return Ok();
}

Result<UpdateOptions> ReadUpdateOptions(const Arguments& arguments) {
  UpdateOptions options = {
      .allow_older = arguments.allow_older, .name = arguments.name, .min_epoch = arguments.min_epoch};
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(options.public_key, ReadPublicKey(arguments.key_path));
  }
  return options;
}

Status Apply(const Arguments& arguments, const CommandEnvironment& environment) {
  if (arguments.in_place != arguments.new_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "apply: give -o NEW to write the new map, or --in-place to replace {}",
                     arguments.old_path);
  }
  CAIRN_ASSIGN_OR_RETURN(const UpdateOptions options, ReadUpdateOptions(arguments));
  if (!arguments.in_place) {
    CAIRN_RETURN_IF_ERROR(ApplyDelta(arguments.old_path, arguments.delta_path, arguments.new_path, options));
    *environment.out << fmt::format("{}: whole\n", arguments.new_path);
    return Ok();
  }
  CAIRN_ASSIGN_OR_RETURN(const bool updated, UpdateMap(arguments.old_path, arguments.delta_path, options));
  *environment.out << (updated ? fmt::format("{}: whole; the map before is {}\n", arguments.old_path,
                                             PreviousMapPath(arguments.old_path))
                               : fmt::format("{}: is the new map already\n", arguments.old_path));
  return Ok();
}

Status Rollback(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const UpdateOptions options, ReadUpdateOptions(arguments));
  CAIRN_RETURN_IF_ERROR(RollBackMap(arguments.old_path, options));
  *environment.out << fmt::format("{}: the map before; the one that it replaces is {}\n", arguments.old_path,
                                  PreviousMapPath(arguments.old_path));
  return Ok();
}

void AddDemands(CLI::App& app, Arguments* arguments, const char* key_help) {
  app.add_option("--public-key", arguments->key_path, key_help)->type_name("KEY.pub");
  app.add_option("--name", arguments->name, "What the map that takes the place must be called")
      ->type_name("NAME");
  AddEpochArgument(app, "--min-epoch", &arguments->min_epoch, 0, "Least epoch that it may have");
}

}  // namespace

Command DeltaCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "delta",
      .summary = "Writes what a robot with one map needs to make another, byte for byte",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("old", arguments->old_path, "Map that the robot has")
                ->required()
                ->type_name("OLD");
            app.add_option("new", arguments->new_path, "Map that it is to have; sign it before")
                ->required()
                ->type_name("NEW");
            app.add_option("-o,--output", arguments->delta_path, "Delta to write")
                ->required()
                ->type_name("D");
            app.add_option("--key", arguments->key_path, "Secret key from keygen, to sign the delta with")
                ->type_name("KEY");
            app.add_flag("--allow-older", arguments->allow_older,
                         "Also to a map of an earlier or the same epoch, which robots refuse unless told so");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return MakeDelta(*arguments, environment); },
  };
}

Command ApplyCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "apply",
      .summary = "Makes the new map from the old one and a delta; refuses any other map",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("old", arguments->old_path, "Map that the delta leads from")
                ->required()
                ->type_name("OLD");
            app.add_option("delta", arguments->delta_path, "What cairn delta wrote")
                ->required()
                ->type_name("D");
            app.add_option("-o,--output", arguments->new_path, "Map to write")->type_name("NEW");
            app.add_flag("--in-place", arguments->in_place,
                         "Replace OLD in one step and keep it as OLD.previous, for cairn rollback");
            app.add_flag("--allow-older", arguments->allow_older,
                         "Let a map of an earlier or the same epoch take a signed map's place");
            AddDemands(app, arguments.get(), "Key whose signature the delta and the new map must have");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Apply(*arguments, environment); },
      .may_be_output = {"old", "--name"},  // of the map, it says what to do instead
  };
}

Command RollbackCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "rollback",
      .summary = "Exchanges a map and the one that apply --in-place replaced",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("map", arguments->old_path, "Map; MAP.previous takes its place")
                ->required()
                ->type_name("MAP");
            AddDemands(app, arguments.get(), "Key whose signature the previous map must have");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Rollback(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
