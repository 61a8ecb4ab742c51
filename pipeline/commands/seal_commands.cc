#include "pipeline/commands/commands.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/atlas/atlas_file.h"
#include "core/blocks/map_rows.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "runtime/atlas/atlas.h"

namespace cairn::pipeline {
namespace {

struct SealArguments {
  std::string input_path;
  std::string key_path;
  std::string output_path;
  std::string previous_path;
  std::string name;
  uint64_t epoch = 0;  // 0: not given; for verify, the smallest allowed
};

// " of epoch 3", where it was counted.
std::string EpochText(const MapHead& head) {
  return head.epoch == 0 ? "" : fmt::format(", of epoch {}", head.epoch);
}

// `required`: the key that was given, if any.
std::string SignatureText(bool is_signed, const PublicKey& key, const std::optional<PublicKey>& required) {
  if (!is_signed) return "not signed";
  return fmt::format("signed with key {}{}", HexOf(key),
                     required ? "" : ", which was not checked against a given key");
}

// Every byte of an atlas, its signature, and that its maps are the files that it was made of.
Status VerifyAtlas(const SealArguments& arguments, const std::optional<PublicKey>& key,
                   const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const auto atlas, Atlas::Open(arguments.input_path, {.public_key = key,
                                                                              .name = arguments.name,
                                                                              .min_epoch = arguments.epoch}));
  for (int map = 0; map < atlas->num_maps(); ++map) CAIRN_RETURN_IF_ERROR(atlas->OpenMap(map));
  *environment.out << fmt::format(
      "{}: whole, {}; its {} maps are the files that it was made of\n", arguments.input_path,
      SignatureText(atlas->rows().is_signed(), atlas->rows().public_key, key), atlas->num_maps());
  return Ok();
}

// Every byte by the file's hash, the signature, then every block and every row.
Status Verify(const SealArguments& arguments, const CommandEnvironment& environment) {
  std::optional<PublicKey> key;
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(key, ReadPublicKey(arguments.key_path));
  }
  if (IsAtlasFile(arguments.input_path)) return VerifyAtlas(arguments, key, environment);
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(arguments.input_path, {.public_key = key}));
  CAIRN_RETURN_IF_ERROR(CheckAskedFor(file.head(), arguments.input_path, arguments.name, arguments.epoch));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(arguments.input_path));
  CAIRN_RETURN_IF_ERROR(ReadMapRows(file));
  *environment.out << fmt::format("{}: whole{}, {}\n", arguments.input_path, EpochText(file.head()),
                                  SignatureText(file.seal().is_signed(), file.seal().public_key, key));
  return Ok();
}

Status Keygen(const SealArguments& arguments, const CommandEnvironment& environment) {
  const KeyPair keys = MakeKeyPair();
  CAIRN_RETURN_IF_ERROR(WriteKeyPair(keys, arguments.output_path));
  *environment.out << fmt::format("{}: keep it secret; {}.pub: for robots ({})\n", arguments.output_path,
                                  arguments.output_path, HexOf(keys.public_key));
  return Ok();
}

Status Sign(const SealArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const SecretKey key, ReadSecretKey(arguments.key_path));
  std::string name;
  {
    CAIRN_ASSIGN_OR_RETURN(const MapFile map, MapFile::Open(arguments.input_path, {}));
    name = map.head().name;
  }
  std::optional<uint64_t> wanted;
  if (arguments.epoch > 0) wanted = arguments.epoch;
  if (!arguments.previous_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(wanted, EpochAfter(arguments.previous_path, name, key));
  }
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(const uint64_t epoch,
                         SignMap(arguments.input_path, key, arguments.output_path, wanted));
  *environment.out << fmt::format(
      "{}: map '{}', epoch {}, signed with key {}; robots that have a signed map of it take only a later "
      "epoch\n",
      arguments.output_path, name, epoch, HexOf(public_key));
  return Ok();
}

Status Migrate(const SealArguments& arguments, const CommandEnvironment& environment) {
  Result<MapRows> read = ReadMapRowsVersion1(arguments.input_path);
  if (!read.ok() && read.error().code == ErrorCode::kTooNew) read = ReadMapRows(arguments.input_path);
  if (!read.ok()) return read.error();
  CAIRN_RETURN_IF_ERROR(WriteMapRows(*read, arguments.output_path));
  *environment.out << fmt::format("{}: map '{}' as version {}.{}, not signed\n", arguments.output_path,
                                  read->name, MapVersionMajor(read->descriptor_kind), kMapVersionMinor);
  return Ok();
}

}  // namespace

Command VerifyCommand() {
  auto arguments = std::make_shared<SealArguments>();
  return {
      .name = "verify",
      .summary = "Check every byte of a map or an atlas, and its signature",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->input_path, "Map, or an atlas of maps").Required().Type("MAP");
            parser.Add("--public-key", arguments->key_path, "Key whose signature the map must have")
                .Type("KEY.pub");
            parser.Add("--name", arguments->name, "Name that the map must have").Type("NAME");
            parser.Add("--min-epoch", arguments->epoch, "Smallest epoch that the map may have")
                .Type("N")
                .WholeNumber(0);
          },
      .run = [arguments](const CommandEnvironment& environment) { return Verify(*arguments, environment); },
  };
}

Command KeygenCommand() {
  auto arguments = std::make_shared<SealArguments>();
  return {
      .name = "keygen",
      .summary = "Make a pair of keys for signing maps",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("key", arguments->output_path, "Secret key to write; KEY.pub is the public one")
                .Required()
                .Type("KEY");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Keygen(*arguments, environment); },
  };
}

Command SignCommand() {
  auto arguments = std::make_shared<SealArguments>();
  return {
      .name = "sign",
      .summary = "Write a signed copy of a map",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->input_path, "Map").Required().Type("MAP");
            parser.Add("--key", arguments->key_path, "Secret key from keygen").Required().Type("KEY");
            parser.Add("-o,--output", arguments->output_path, "Signed map to write")
                .Required()
                .Type("SIGNED");
            const Argument epoch =
                parser.Add("--epoch", arguments->epoch, "Epoch of the map [that of the map, or 1]")
                    .Type("N")
                    .WholeNumber(1);
            parser
                .Add("--after", arguments->previous_path,
                     "Map that this one follows, signed with the same key: its epoch plus 1 is used")
                .Excludes(epoch)
                .Type("PREVIOUS");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Sign(*arguments, environment); },
  };
}

Command MigrateCommand() {
  auto arguments = std::make_shared<SealArguments>();
  return {
      .name = "migrate",
      .summary = "Convert a map of an earlier format to the current one",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->input_path, "Map of format 1.0 to the current one")
                .Required()
                .Type("OLD");
            parser.Add("-o,--output", arguments->output_path, "Map to write").Required().Type("NEW");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Migrate(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
