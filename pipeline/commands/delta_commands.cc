#include "pipeline/commands/commands.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/delta/map_delta.h"
#include "core/delta/renumbering.h"
#include "core/files/file.h"
#include "core/files/output_path.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature_list.h"
#include "runtime/map/update_map.h"

namespace cairn::pipeline {
namespace {

struct DeltaArguments {
  std::string old_path;
  std::string new_path;
  std::string delta_path;
  std::string key_path;
  std::string signatures_path;
  std::string name;
  uint64_t min_epoch = 0;
  bool allow_older = false;
  bool in_place = false;
};

// The number of blocks of a map that the other one has too.
size_t NumSharedBlocks(const MapFile& map, const MapFile& other) {
  std::set<Hash> hashes;
  for (const BlockEntry& entry : other.directory().blocks()) hashes.insert(entry.hash);
  return std::count_if(map.directory().blocks().begin(), map.directory().blocks().end(),
                       [&](const BlockEntry& entry) { return hashes.contains(entry.hash); });
}

Status MakeDelta(const DeltaArguments& arguments, const CommandEnvironment& environment) {
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
  const std::vector<int32_t> origins = FindSame(old_rows, new_rows).landmarks;
  const std::string told = fmt::format(
      "{}: {} bytes, {:.2f} % of {}'s {}; {} of {} landmarks and {} of {} blocks are not {}'s{}\n",
      arguments.delta_path, bytes.size(),
      100.0 * static_cast<double>(bytes.size()) / static_cast<double>(delta.new_num_bytes),
      arguments.new_path, delta.new_num_bytes, std::count(origins.begin(), origins.end(), Renumbering::kNew),
      origins.size(), num_blocks - NumSharedBlocks(new_map, old_map), num_blocks, arguments.old_path,
      delta.is_signed() ? "" : "; not signed");
  // What other keys have signed goes with it: whoever sees the delta has its signatures.
  CAIRN_ASSIGN_OR_RETURN(const SignatureList beside,
                         ReadSignaturesIfThere(SignaturesPath(FileOf(arguments.new_path))));
  const SignatureList signatures = ValidSignatures(SignedBytesOf(new_map.seal()), beside);
  const std::string signatures_path = SignaturesPath(arguments.delta_path);
  if (!signatures.empty())
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(signatures_path, EncodeSignatures(signatures)));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.delta_path, bytes));
  *environment.out << told;
  if (!signatures.empty()) {
    *environment.out << fmt::format("{}: {} more signatures of {}; send it with the delta\n", signatures_path,
                                    signatures.size(), arguments.new_path);
  }
  return Ok();
}

Result<UpdateOptions> ReadUpdateOptions(const DeltaArguments& arguments) {
  UpdateOptions options = {.allow_older = arguments.allow_older,
                           .name = arguments.name,
                           .min_epoch = arguments.min_epoch,
                           .signatures = arguments.signatures_path};
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(options.public_key, ReadTrustedKeys(arguments.key_path));
  }
  return options;
}

Status Apply(const DeltaArguments& arguments, const CommandEnvironment& environment) {
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

Status Rollback(const DeltaArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const UpdateOptions options, ReadUpdateOptions(arguments));
  CAIRN_RETURN_IF_ERROR(RollBackMap(arguments.old_path, options));
  *environment.out << fmt::format("{}: the map before; the one that it replaces is {}\n", arguments.old_path,
                                  PreviousMapPath(arguments.old_path));
  return Ok();
}

void AddDemands(ArgumentParser& parser, DeltaArguments* arguments, const char* key_help) {
  parser.Add("--public-key", arguments->key_path, key_help).Type("KEY.pub|RING");
  parser.Add("--name", arguments->name, "Name that the replacing map must have").Type("NAME");
  parser.Add("--min-epoch", arguments->min_epoch, "Smallest epoch that the replacing map may have")
      .Type("N")
      .WholeNumber(0);
}

}  // namespace

Command DeltaCommand() {
  auto arguments = std::make_shared<DeltaArguments>();
  return {
      .name = "delta",
      .summary = "Write what a robot with one map needs to make another, byte for byte",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("old", arguments->old_path, "Map that the robot has").Required().Type("OLD");
            parser.Add("new", arguments->new_path, "Map that the robot is to get; sign it first")
                .Required()
                .Type("NEW");
            parser.Add("-o,--output", arguments->delta_path, "Delta to write").Required().Type("D");
            parser.Add("--key", arguments->key_path, "Secret key from keygen, to sign the delta with")
                .Type("KEY");
            parser.AddFlag("--allow-older", arguments->allow_older,
                           "Allow a NEW of an earlier or the same epoch, which robots refuse by default");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return MakeDelta(*arguments, environment); },
  };
}

Command ApplyCommand() {
  auto arguments = std::make_shared<DeltaArguments>();
  return {
      .name = "apply",
      .summary = "Make the new map from the old one and a delta",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("old", arguments->old_path, "Map that the delta starts from").Required().Type("OLD");
            parser.Add("delta", arguments->delta_path, "Delta that cairn update delta wrote")
                .Required()
                .Type("D");
            parser.Add("-o,--output", arguments->new_path, "Map to write").Type("NEW");
            parser.AddFlag("--in-place", arguments->in_place,
                           "Replace OLD in one step and keep it as OLD.previous, for cairn update rollback");
            parser.AddFlag("--allow-older", arguments->allow_older,
                           "Let a map of an earlier or the same epoch replace a signed map");
            AddDemands(
                parser, arguments.get(),
                "Key whose signature the delta and the new map must have, or ring of the keys that may sign "
                "them");
            parser
                .Add("--signatures", arguments->signatures_path,
                     "More signatures of the new map [D.signatures, where it is there]")
                .Type("FILE");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Apply(*arguments, environment); },
      .may_be_output = {"old", "--name"},  // Apply has its own message where these are the output
  };
}

Command RollbackCommand() {
  auto arguments = std::make_shared<DeltaArguments>();
  return {
      .name = "rollback",
      .summary = "Swap a map and the one that it replaced (apply --in-place)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->old_path, "Map; MAP.previous takes its place")
                .Required()
                .Type("MAP");
            AddDemands(
                parser, arguments.get(),
                "Key whose signature the previous map must have, or ring of the keys that may sign it");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Rollback(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
