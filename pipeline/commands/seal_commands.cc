#include "pipeline/commands/commands.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/atlas/atlas_file.h"
#include "core/blocks/map_rows.h"
#include "core/files/output_path.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature.h"
#include "runtime/atlas/atlas.h"

namespace cairn::pipeline {
namespace {

struct SealArguments {
  std::string input_path;
  std::string key_path;
  std::string trusted_path;
  std::string output_path;
  std::string previous_path;
  std::string name;
  uint64_t epoch = 0;  // 0: not given; for verify, the smallest allowed
  bool add = false;
};

// " of epoch 3", where it was counted.
std::string EpochText(const MapHead& head) {
  return head.epoch == 0 ? "" : fmt::format(", of epoch {}", head.epoch);
}

// `signed_bytes`: what the key of a file, and those of the signatures beside it, have signed.  `required`:
// what was given to check it against, if anything.
std::string SignatureText(const std::string& path, bool is_signed, const KeySignature& own,
                          const std::string& signed_bytes, const std::optional<KeyRing>& required) {
  if (!is_signed) return "not signed";
  const std::string by_key = "signed with key " + HexOf(own.public_key);
  if (!required) return by_key + ", which was not checked against a given key";
  if (required->is_single_key()) return "signed with " + required->Description();
  // Beside a file whose own signature is enough there may be anything.
  const Result<SignatureList> beside = ReadSignaturesIfThere(SignaturesPath(FileOf(path)));
  SignatureList signatures = beside.ok() ? *beside : SignatureList();
  signatures.push_back(own);
  return fmt::format("signed by {}, of {}, which requires {}",
                     fmt::join(SignersOf(signed_bytes, signatures, *required), ", "), required->Description(),
                     required->threshold);
}

// Every byte of an atlas, its signature, and that its maps are the files that it was made of.
Status VerifyAtlas(const SealArguments& arguments, const std::optional<KeyRing>& trusted,
                   const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const auto atlas, Atlas::Open(arguments.input_path, {.public_key = trusted,
                                                                              .name = arguments.name,
                                                                              .min_epoch = arguments.epoch}));
  for (int map = 0; map < atlas->num_maps(); ++map) CAIRN_RETURN_IF_ERROR(atlas->OpenMap(map));
  const AtlasRows& rows = atlas->rows();
  const std::string text = SignatureText(arguments.input_path, rows.is_signed(),
                                         {rows.public_key, rows.signature}, SignedBytesOf(rows), trusted);
  *environment.out << fmt::format("{}: whole, {}; its {} maps are the files that it was made of\n",
                                  arguments.input_path, text, atlas->num_maps());
  return Ok();
}

// Every byte by the file's hash, the signatures, then every block and every row.
Status Verify(const SealArguments& arguments, const CommandEnvironment& environment) {
  std::optional<KeyRing> trusted;
  if (!arguments.trusted_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(trusted, ReadTrustedKeys(arguments.trusted_path));
  }
  if (IsAtlasFile(arguments.input_path)) return VerifyAtlas(arguments, trusted, environment);
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(arguments.input_path, {.public_key = trusted}));
  CAIRN_RETURN_IF_ERROR(CheckAskedFor(file.head(), arguments.input_path, arguments.name, arguments.epoch));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(arguments.input_path));
  CAIRN_RETURN_IF_ERROR(ReadMapRows(file));
  const Seal& seal = file.seal();
  const std::string text = SignatureText(arguments.input_path, seal.is_signed(),
                                         {seal.public_key, seal.signature}, SignedBytesOf(seal), trusted);
  *environment.out << fmt::format("{}: whole{}, {}\n", arguments.input_path, EpochText(file.head()), text);
  return Ok();
}

Status Keygen(const SealArguments& arguments, const CommandEnvironment& environment) {
  const KeyPair keys = MakeKeyPair();
  CAIRN_RETURN_IF_ERROR(WriteKeyPair(keys, arguments.output_path));
  *environment.out << fmt::format("{}: keep it secret; {}.pub: for robots ({})\n", arguments.output_path,
                                  arguments.output_path, HexOf(keys.public_key));
  return Ok();
}

// One more signature of a map or an atlas, which stays as it is.
Status AddOneSignature(const SealArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const SecretKey key, ReadSecretKey(arguments.key_path));
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  const std::string path =
      arguments.output_path.empty() ? SignaturesPath(FileOf(arguments.input_path)) : arguments.output_path;
  std::string what = "atlas";
  if (IsAtlasFile(arguments.input_path)) {
    CAIRN_RETURN_IF_ERROR(AddAtlasSignature(arguments.input_path, key, path));
  } else {
    CAIRN_RETURN_IF_ERROR(AddMapSignature(arguments.input_path, key, path));
    CAIRN_ASSIGN_OR_RETURN(const MapFile map, MapFile::Open(arguments.input_path, {}));
    what = fmt::format("map '{}'{}", map.head().name, EpochText(map.head()));
  }
  *environment.out << fmt::format("{}: has the signature of {}, {}, by key {}; keep it beside it as {}\n",
                                  path, arguments.input_path, what, HexOf(public_key),
                                  SignaturesPath(arguments.input_path));
  return Ok();
}

Status Sign(const SealArguments& arguments, const CommandEnvironment& environment) {
  if (arguments.add) {
    if (arguments.epoch == 0 && arguments.previous_path.empty() && arguments.trusted_path.empty())
      return AddOneSignature(arguments, environment);
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--add: signs {} as it is; --epoch, --after and --public-key are for the first signature",
        arguments.input_path);
  }
  if (arguments.output_path.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "-o: give the signed map to write, or --add to sign {} besides those who have",
                     arguments.input_path);
  }
  if (!arguments.trusted_path.empty() && arguments.previous_path.empty())
    return MakeError(ErrorCode::kInvalidArgument,
                     "--public-key: is of the map of --after, which is not given");
  CAIRN_ASSIGN_OR_RETURN(const SecretKey key, ReadSecretKey(arguments.key_path));
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  std::string name;
  {
    CAIRN_ASSIGN_OR_RETURN(const MapFile map, MapFile::Open(arguments.input_path, {}));
    name = map.head().name;
  }
  std::optional<uint64_t> wanted;
  if (arguments.epoch > 0) wanted = arguments.epoch;
  if (!arguments.previous_path.empty()) {
    KeyRing trusted = public_key;
    if (!arguments.trusted_path.empty()) {
      CAIRN_ASSIGN_OR_RETURN(trusted, ReadTrustedKeys(arguments.trusted_path));
    }
    CAIRN_ASSIGN_OR_RETURN(wanted, EpochAfter(arguments.previous_path, name, trusted));
  }
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
            parser
                .Add("--public-key", arguments->trusted_path,
                     "Key whose signature the map must have, or ring of the keys that may sign it")
                .Type("KEY.pub|RING");
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
      .summary = "Write a signed copy of a map, or add a signature to those of others",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->input_path, "Map; with --add, or an atlas of maps")
                .Required()
                .Type("MAP");
            parser.Add("--key", arguments->key_path, "Secret key from keygen").Required().Type("KEY");
            parser
                .Add(
                    "-o,--output", arguments->output_path,
                    "Signed map to write; with --add, file of signatures that gets one more [MAP.signatures]")
                .Type("SIGNED");
            parser.AddFlag(
                "--add", arguments->add,
                "Leave MAP, which somebody has signed, as it is, and sign it, too, in a file beside it");
            const Argument epoch =
                parser.Add("--epoch", arguments->epoch, "Epoch of the map [that of the map, or 1]")
                    .Type("N")
                    .WholeNumber(1);
            parser
                .Add("--after", arguments->previous_path,
                     "Map that this one follows: its epoch plus 1 is used")
                .Excludes(epoch)
                .Type("PREVIOUS");
            parser
                .Add("--public-key", arguments->trusted_path,
                     "Key, or ring of keys, with which PREVIOUS is signed [that of --key]")
                .Type("KEY.pub|RING");
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
