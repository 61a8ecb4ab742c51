#include "core/seal/key_ring.h"

#include <sodium.h>
#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <utility>

#include "core/seal/key_text.h"

namespace cairn {
namespace {

constexpr std::string_view kRingWords = "cairn key ring ";
constexpr std::string_view kRingFormat = "1";

bool IsKeyName(std::string_view name) {
  return !name.empty() && name.size() <= KeyRing::kMaxNameBytes &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
                  c == '_' || c == '-' || c == '@';
         });
}

// A whole number of at least 1, written in the one way that there is: so a ring has one text.
std::optional<uint64_t> CountOf(std::string_view text) {
  uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || text.starts_with('0')) return std::nullopt;
  return number;
}

// The text up to the next space, which is taken away.
std::string_view NextWord(std::string_view* line) {
  const std::string_view word = line->substr(0, line->find(' '));
  line->remove_prefix(std::min(word.size() + 1, line->size()));
  return word;
}

// Reads the lines of a ring one by one.
class RingReader {
 public:
  RingReader(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  Result<KeyRing> Read() {
    CAIRN_ASSIGN_OR_RETURN(const std::string_view first, NextLine(&text_, &num_lines_, path_));
    if (!first.starts_with(kRingWords)) return Fault("expected 'cairn key ring 1'");
    if (first.substr(kRingWords.size()) != kRingFormat) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: a ring of another format than 'cairn key ring 1', which this program reads",
                       path_);
    }
    CAIRN_ASSIGN_OR_RETURN(std::string_view version, Next("version"));
    const std::optional<uint64_t> number = CountOf(version);
    if (!number) return Fault("expected 'version N', N a whole number from 1 on");
    ring_.version = *number;
    CAIRN_ASSIGN_OR_RETURN(std::string_view threshold, Next("threshold"));
    const std::optional<uint64_t> least = CountOf(NextWord(&threshold));
    const std::string_view of = NextWord(&threshold);
    const std::optional<uint64_t> num_keys = CountOf(threshold);
    if (!least || of != "of" || !num_keys)
      return Fault("expected 'threshold K of N', whole numbers from 1 on");
    if (*num_keys > KeyRing::kMaxNumKeys) return Fault("a ring has at most 64 keys");
    if (*least > *num_keys) return Fault("the threshold is larger than the number of keys");
    ring_.threshold = static_cast<int>(*least);
    while (true) {
      SkipComments();
      if (text_.empty()) break;
      CAIRN_RETURN_IF_ERROR(ReadKey());
    }
    if (ring_.keys.size() != *num_keys) {
      return Corrupt(
          path_, "has {} keys, but line 'threshold' says {}: the ring was cut off or edited; copy it again",
          ring_.keys.size(), *num_keys);
    }
    if (const Status status = CheckKeyRing(ring_); !status.ok())
      return MakeError(status.error().code, "{}: {}", path_, status.error().message);
    return std::move(ring_);
  }

 private:
  // What a line says is not shown: it may be a secret key.
  Error Fault(const char* what) const {
    return MakeError(ErrorCode::kCorrupt, "{}: line {}: {}; `cairn keys make` writes such a file", path_,
                     num_lines_, what);
  }

  void SkipComments() {
    while (text_.starts_with('\n') ||
           (text_.starts_with('#') && text_.find('\n') != std::string_view::npos)) {
      text_.remove_prefix(text_.find('\n') + 1);
      ++num_lines_;
    }
  }

  // What follows this word on the next line that is no comment.
  Result<std::string_view> Next(std::string_view word) {
    SkipComments();
    if (text_.empty()) return Corrupt(path_, "has no line '{}': the ring was cut off; copy it again", word);
    CAIRN_ASSIGN_OR_RETURN(std::string_view line, NextLine(&text_, &num_lines_, path_));
    if (NextWord(&line) == word) return line;
    return Fault(word == "key"       ? "expected 'key PUBLIC_KEY NAME'"
                 : word == "version" ? "expected 'version N'"
                                     : "expected 'threshold K of N'");
  }

  Status ReadKey() {
    CAIRN_ASSIGN_OR_RETURN(std::string_view name, Next("key"));
    const std::string_view digits = NextWord(&name);
    KeyRing::Key key;
    if (digits.size() == 4 * key.public_key.size() && IsHex(digits)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: line {}: has a secret key; use a new one from `cairn keygen` in its place, and its "
          "public half, as whoever has seen this file can sign with it",
          path_, num_lines_);
    }
    if (digits.size() != 2 * key.public_key.size() || !IsHex(digits))
      return Fault("expected 'key PUBLIC_KEY NAME' with 64 hexadecimal digits");
    DecodeHex(digits, key.public_key.data(), key.public_key.size());
    // Two keys that differ by a point of small order would be one key that counts twice.
    if (crypto_core_ed25519_is_valid_point(key.public_key.data()) == 0)
      return Fault("its key is not a point of the curve's main subgroup, so it is nobody's; copy it again");
    key.name = name;
    ring_.keys.push_back(std::move(key));
    return Ok();
  }

  std::string_view text_;
  const std::string& path_;
  int num_lines_ = 0;
  KeyRing ring_;
};

// The text of a file that says whom to trust.
Status ReadTrustText(const std::string& path, KeyText* text) {
  CAIRN_RETURN_IF_ERROR(text->Read(
      path, "a public key from `cairn keygen` or a ring from `cairn keys make`", KeyRing::kMaxNumBytes,
      S_IWOTH,
      fmt::format("a file that not everybody may write, since it says whom a robot trusts; `chmod o-w {}`",
                  path)));
  return Ok();
}

}  // namespace

std::string KeyRing::Description() const {
  if (is_single_key()) return keys.empty() ? "no key" : "key " + HexOf(keys.front().public_key);
  std::string names;
  for (const Key& key : keys) names += (names.empty() ? "" : ", ") + key.name;
  return fmt::format("ring {} ({})", version, names);
}

const KeyRing::Key* KeyRing::Find(const PublicKey& public_key) const {
  const auto found =
      std::find_if(keys.begin(), keys.end(), [&](const Key& key) { return key.public_key == public_key; });
  return found == keys.end() ? nullptr : &*found;
}

Status CheckKeyRing(const KeyRing& ring) {
  if (ring.keys.empty() || ring.keys.size() > KeyRing::kMaxNumKeys) {
    return MakeError(ErrorCode::kInvalidArgument, "a ring of {} keys, expected 1 to {}", ring.keys.size(),
                     KeyRing::kMaxNumKeys);
  }
  if (ring.threshold < 1 || static_cast<size_t>(ring.threshold) > ring.keys.size()) {
    return MakeError(ErrorCode::kInvalidArgument, "a threshold of {} of {} keys, expected 1 to {}",
                     ring.threshold, ring.keys.size(), ring.keys.size());
  }
  if (ring.is_single_key() && ring.keys.size() > 1) {
    return MakeError(ErrorCode::kInvalidArgument, "a ring of {} keys and version 0; count from 1",
                     ring.keys.size());
  }
  std::set<std::string> names;
  std::set<PublicKey> keys;
  for (const KeyRing::Key& key : ring.keys) {
    if (!ring.is_single_key() && !IsKeyName(key.name)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "key {} has no name of 1 to {} letters, digits, '.', '_', '-' or '@'",
                       HexOf(key.public_key), KeyRing::kMaxNameBytes);
    }
    if (!names.insert(key.name).second)
      return MakeError(ErrorCode::kInvalidArgument, "two keys have the name '{}'", key.name);
    if (!keys.insert(key.public_key).second) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "key {} is there twice, the second time as '{}': each counts once",
                       HexOf(key.public_key), key.name);
    }
  }
  return Ok();
}

Result<std::string> EncodeKeyRing(const KeyRing& ring) {
  CAIRN_RETURN_IF_ERROR(CheckKeyRing(ring));
  if (ring.is_single_key())
    return MakeError(ErrorCode::kInvalidArgument, "a ring of version 0; count from 1");
  std::string text = fmt::format("{}{}\nversion {}\nthreshold {} of {}\n", kRingWords, kRingFormat,
                                 ring.version, ring.threshold, ring.keys.size());
  for (const KeyRing::Key& key : ring.keys)
    text += fmt::format("key {} {}\n", HexOf(key.public_key), key.name);
  return text;
}

Result<KeyRing> DecodeKeyRing(std::string_view text, const std::string& path) {
  if (text.size() > KeyRing::kMaxNumBytes) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is larger than {} bytes, and a ring of {} keys never is; take out comments", path,
                     KeyRing::kMaxNumBytes, KeyRing::kMaxNumKeys);
  }
  if (text.empty()) return MakeError(ErrorCode::kEmptyFile, "{}: is empty, expected a ring of keys", path);
  return RingReader(text, path).Read();
}

Result<KeyRing> ReadTrustedKeys(const std::string& path) {
  KeyText text;
  CAIRN_RETURN_IF_ERROR(ReadTrustText(path, &text));
  if (text.view().starts_with(kRingWords)) return DecodeKeyRing(text.view(), path);
  CAIRN_ASSIGN_OR_RETURN(const PublicKey key, PublicKeyOfText(text.trimmed(), path));
  return KeyRing(key);
}

Result<KeyRingFile> ReadKeyRing(const std::string& path) {
  KeyText text;
  CAIRN_RETURN_IF_ERROR(ReadTrustText(path, &text));
  KeyRingFile file;
  CAIRN_ASSIGN_OR_RETURN(file.ring, DecodeKeyRing(text.view(), path));
  file.text = text.view();
  return file;
}

}  // namespace cairn
