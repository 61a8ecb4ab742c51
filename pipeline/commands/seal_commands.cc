#include "pipeline/commands/commands.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/blocks/map_rows.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "pipeline/commands/epoch_argument.h"

namespace cairn::pipeline {
namespace {

struct Arguments {
  std::string input_path;
  std::string key_path;
  std::string output_path;
  std::string previous_path;
  std::string name;
  uint64_t epoch = 0;  // 0: not given; of verify, the least
};

// " of epoch 3", where it was counted.
std::string EpochText(const MapHead& head) {
  return head.epoch == 0 ? "" : fmt::format(", of epoch {}", head.epoch);
}

// Every byte by the file's hash, the signature, then every block and every row.
Status Verify(const Arguments& arguments, const CommandEnvironment& environment) {
  MapFileOptions options;
  if (!arguments.key_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(options.public_key, ReadPublicKey(arguments.key_path));
  }
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(arguments.input_path, options));
  CAIRN_RETURN_IF_ERROR(CheckAskedFor(file.head(), arguments.input_path, arguments.name, arguments.epoch));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(arguments.input_path));
  CAIRN_RETURN_IF_ERROR(ReadMapRows(file));
  *environment.out << fmt::format("{}: whole{}, {}\n", arguments.input_path, EpochText(file.head()),
                                  file.seal().is_signed()
                                      ? fmt::format("signed with key {}{}", HexOf(file.seal().public_key),
                                                    options.public_key ? "" : ", which nobody asked for")
                                      : "not signed");
  return Ok();
}

Status Keygen(const Arguments& arguments, const CommandEnvironment& environment) {
  const KeyPair keys = MakeKeyPair();
  CAIRN_RETURN_IF_ERROR(WriteKeyPair(keys, arguments.output_path));
  *environment.out << fmt::format("{}: keep it secret; {}.pub: for robots ({})\n", arguments.output_path,
                                  arguments.output_path, HexOf(keys.public_key));
  return Ok();
}

Status Sign(const Arguments& arguments, const CommandEnvironment& environment) {
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

Status Migrate(const Arguments& arguments, const CommandEnvironment& environment) {
  Result<MapRows> read = ReadMapRowsVersion1(arguments.input_path);
  if (!read.ok() && read.error().code == ErrorCode::kTooNew) read = ReadMapRows(arguments.input_path);
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, std::move(read));
  CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, arguments.output_path));
  *environment.out << fmt::format("{}: map '{}' as version {}.{}, not signed\n", arguments.output_path,
                                  rows.name, kMapVersionMajor, kMapVersionMinor);
  return Ok();
}

}  // namespace

Command VerifyCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "verify",
      .summary = "Checks every byte of a map, and its signature",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("map", arguments->input_path, "Map")->required()->type_name("MAP");
            app.add_option("--public-key", arguments->key_path, "Key whose signature the map must have")
                ->type_name("KEY.pub");
            app.add_option("--name", arguments->name, "What the map must be called")->type_name("NAME");
            AddEpochArgument(app, "--min-epoch", &arguments->epoch, 0, "Least epoch that the map may have");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Verify(*arguments, environment); },
  };
}

Command KeygenCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "keygen",
      .summary = "Makes a pair of keys for signing maps",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("key", arguments->output_path, "Secret key to write; KEY.pub is the public one")
                ->required()
                ->type_name("KEY");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Keygen(*arguments, environment); },
  };
}

Command SignCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "sign",
      .summary = "Writes a signed copy of a map",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("map", arguments->input_path, "Map")->required()->type_name("MAP");
            app.add_option("--key", arguments->key_path, "Secret key from keygen")
                ->required()
                ->type_name("KEY");
            app.add_option("-o,--output", arguments->output_path, "Signed map to write")
                ->required()
                ->type_name("SIGNED");
            CLI::Option* const epoch = AddEpochArgument(app, "--epoch", &arguments->epoch, 1,
                                                        "Epoch of the map [that of the map, or 1]");
            app.add_option("--after", arguments->previous_path,
                           "Map that this one follows, signed with the same key: the epoch after its one")
                ->excludes(epoch)
                ->type_name("PREVIOUS");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Sign(*arguments, environment); },
  };
}

Command MigrateCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "migrate",
      .summary = "Writes a map of an earlier format in today's",
      .add_arguments =
          [arguments](CLI::App& app) {
            app.add_option("map", arguments->input_path, "Map of format 1.0 to today's")
                ->required()
                ->type_name("OLD");
            app.add_option("-o,--output", arguments->output_path, "Map to write")
                ->required()
                ->type_name("NEW");
          },
      .run = [arguments](const CommandEnvironment& environment) { return Migrate(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
