#include "pipeline/commands/commands.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/files/file.h"
#include "core/seal/accept_key_ring.h"
#include "core/seal/key_ring.h"
#include "core/seal/signature.h"

namespace cairn::pipeline {
namespace {

struct KeysArguments {
  std::vector<std::string> keys;  // "NAME=KEY.pub"
  std::string ring_path;
  std::vector<std::string> next_paths;
  std::string previous_path;
  std::string key_path;
  std::string output_path;
  uint64_t threshold = 0;
};

Status MakeRing(const KeysArguments& arguments, const CommandEnvironment& environment) {
  KeyRing ring;
  ring.version = 1;
  std::string signers = "its robots get it as they get their program";
  if (!arguments.previous_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const KeyRingFile previous, ReadKeyRing(arguments.previous_path));
    if (previous.ring.version == std::numeric_limits<uint64_t>::max())
      return MakeError(ErrorCode::kInvalidArgument, "{}: is the last version that there can be",
                       arguments.previous_path);
    ring.version = previous.ring.version + 1;
    signers =
        fmt::format("robots with {} take it when {} of that ring's keys and {} of its own have signed it",
                    arguments.previous_path, previous.ring.threshold, arguments.threshold);
  }
  for (const std::string& text : arguments.keys) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || equals + 1 == text.size())
      return MakeError(ErrorCode::kInvalidArgument, "'{}': expected NAME=KEY.pub", text);
    CAIRN_ASSIGN_OR_RETURN(const PublicKey key, ReadPublicKey(text.substr(equals + 1)));
    ring.keys.push_back({text.substr(0, equals), key});
  }
  ring.threshold = static_cast<int>(std::min<uint64_t>(arguments.threshold, KeyRing::kMaxNumKeys + 1));
  CAIRN_ASSIGN_OR_RETURN(const std::string text, EncodeKeyRing(ring));
  CAIRN_RETURN_IF_ERROR(
      DecodeKeyRing(text, arguments.output_path));  // also whether the keys can be anybody's
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.output_path, text));
  *environment.out << fmt::format("{}: {}, {} of whom must sign; {}\n", arguments.output_path,
                                  ring.Description(), ring.threshold, signers);
  return Ok();
}

Status SignRing(const KeysArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const SecretKey key, ReadSecretKey(arguments.key_path));
  CAIRN_ASSIGN_OR_RETURN(const PublicKey public_key, PublicKeyOf(key));
  CAIRN_ASSIGN_OR_RETURN(const KeyRingFile file, ReadKeyRing(arguments.ring_path));
  CAIRN_RETURN_IF_ERROR(SignKeyRing(arguments.ring_path, key));
  const KeyRing::Key* const own = file.ring.Find(public_key);
  *environment.out << fmt::format(
      "{}: has the signature of {} by {}\n", SignaturesPath(arguments.ring_path), file.ring.Description(),
      own != nullptr ? own->name : fmt::format("key {}, which it lacks", HexOf(public_key)));
  return Ok();
}

Status ShowRing(const KeysArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const KeyRingFile file, ReadKeyRing(arguments.ring_path));
  CAIRN_ASSIGN_OR_RETURN(const SignatureList signatures,
                         ReadSignaturesIfThere(SignaturesPath(arguments.ring_path)));
  if (!arguments.previous_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const KeyRingFile previous, ReadKeyRing(arguments.previous_path));
    CAIRN_RETURN_IF_ERROR(CheckNextKeyRing(previous.ring, file, signatures, arguments.ring_path));
  }
  const std::vector<std::string> signers = SignersOf(file.text, signatures, file.ring);
  *environment.out << fmt::format("ring {}: {} of {} keys must sign\n", file.ring.version,
                                  file.ring.threshold, file.ring.keys.size());
  for (const KeyRing::Key& key : file.ring.keys) {
    const bool has_signed = std::find(signers.begin(), signers.end(), key.name) != signers.end();
    *environment.out << fmt::format("{} {}{}\n", HexOf(key.public_key), key.name,
                                    has_signed ? ", who has signed this ring" : "");
  }
  if (!arguments.previous_path.empty()) {
    *environment.out << fmt::format("follows {}: robots that have that one take it\n",
                                    arguments.previous_path);
  }
  return Ok();
}

Status AcceptRing(const KeysArguments& arguments, const CommandEnvironment& environment) {
  CAIRN_ASSIGN_OR_RETURN(const KeyRing ring, AcceptKeyRings(arguments.ring_path, arguments.next_paths));
  *environment.out << fmt::format("{}: is {}, {} of whom must sign\n", arguments.ring_path,
                                  ring.Description(), ring.threshold);
  return Ok();
}

}  // namespace

Command MakeKeysCommand() {
  auto arguments = std::make_shared<KeysArguments>();
  return {
      .name = "make",
      .summary = "Write a ring: the keys that robots trust, and how many of them must sign",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("keys", arguments->keys, "Whose public key it is and the key, once per key")
                .Required()
                .Type("NAME=KEY.pub");
            parser
                .Add("--threshold", arguments->threshold, "So many different keys must sign what is trusted")
                .Required()
                .Type("K")
                .WholeNumber(1);
            parser
                .Add("--after", arguments->previous_path,
                     "Ring that this one replaces [none: the first ring]")
                .Type("RING");
            parser.Add("-o,--output", arguments->output_path, "Ring to write").Required().Type("RING");
          },
      .run = [arguments](const CommandEnvironment& environment) { return MakeRing(*arguments, environment); },
  };
}

Command SignKeysCommand() {
  auto arguments = std::make_shared<KeysArguments>();
  return {
      .name = "sign",
      .summary = "Add the signature of a key of a ring, or of the ring before it, to RING.signatures",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("ring", arguments->ring_path, "Ring, which stays as it is").Required().Type("RING");
            parser.Add("--key", arguments->key_path, "Secret key from keygen").Required().Type("KEY");
          },
      .run = [arguments](const CommandEnvironment& environment) { return SignRing(*arguments, environment); },
  };
}

Command ShowKeysCommand() {
  auto arguments = std::make_shared<KeysArguments>();
  return {
      .name = "show",
      .summary = "Say whose keys a ring has, who has signed it, and whether robots would take it",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("ring", arguments->ring_path, "Ring").Required().Type("RING");
            parser.Add("--after", arguments->previous_path, "Ring that robots have, and that it must follow")
                .Type("RING");
          },
      .run = [arguments](const CommandEnvironment& environment) { return ShowRing(*arguments, environment); },
  };
}

Command AcceptKeysCommand() {
  auto arguments = std::make_shared<KeysArguments>();
  return {
      .name = "accept",
      .summary = "Replace a robot's ring by a later one that its keys have signed",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("ring", arguments->ring_path, "The robot's ring").Required().Type("RING");
            parser
                .Add("next", arguments->next_paths,
                     "The rings after it in turn, each with its signatures beside it; earlier ones are "
                     "passed over")
                .Required()
                .Type("NEXT");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return AcceptRing(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
