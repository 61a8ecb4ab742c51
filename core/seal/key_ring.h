#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/seal/signing_key.h"

namespace cairn {

// The keys that a robot trusts: what at least `threshold` different ones of them have signed.  A public key
// alone is the ring of it.  As a text file, which `cairn keys make` writes:
//
//   cairn key ring 1
//   # the workshop's, from May on
//   version 2
//   threshold 2 of 3
//   key d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a alice
//   key 3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c bob
//   key fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025 carol
//
// 1 is the format's version.  After the first line, lines that begin with '#' and empty lines are comments.
// All others come in this order, each ends with a line feed, and between words is one space.  `of 3` tells a
// ring that was cut off.
struct KeyRing {
  // Bounds of a file, checked before it is taken apart.
  static constexpr size_t kMaxNumBytes = 16384;
  static constexpr size_t kMaxNumKeys = 64;
  static constexpr size_t kMaxNameBytes = 64;

  struct Key {
    std::string name;  // 1 to kMaxNameBytes letters, digits, '.', '_', '-' or '@'; empty: a public key alone
    PublicKey public_key = {};
  };

  KeyRing() = default;                                              // trusts nothing
  KeyRing(const PublicKey& public_key) : keys{{"", public_key}} {}  // NOLINT(google-explicit-constructor)

  bool is_single_key() const { return version == 0; }
  // "ring 2 (alice, bob, carol)", for messages.
  std::string Description() const;
  // Its key of that number; nullptr: none.
  const Key* Find(const PublicKey& public_key) const;

  uint64_t version = 0;  // counts from 1; 0: a public key alone
  int threshold = 1;     // 1 to the number of keys
  std::vector<Key> keys;
};

// Whether a ring can be meant.  Errors: InvalidArgument (no key or too many, a threshold that is not 1 to
// their number, a name that is not one or given twice, a key given twice, several keys and version 0).
Status CheckKeyRing(const KeyRing& ring);

// Errors: as CheckKeyRing; InvalidArgument (version 0).
Result<std::string> EncodeKeyRing(const KeyRing& ring);
// `path` is for messages, which never show a key that may be secret.  Errors: Corrupt (not the format, cut
// off, numbers that are none, a key that is no point of the curve); Unsupported (a later format);
// InvalidArgument (larger than kMaxNumBytes, has a secret key, or as CheckKeyRing).
Result<KeyRing> DecodeKeyRing(std::string_view text, const std::string& path);

// What a robot is told to trust: the file of a ring or of a public key; its contents say which.
// Errors: as DecodeKeyRing or ReadPublicKey; NotFound; Io; InvalidArgument (not a regular file, or everybody
// may write it: then anybody says whom the robot trusts).
Result<KeyRing> ReadTrustedKeys(const std::string& path);
// A ring alone, with the text that its signatures are of.  Errors: also Corrupt where it is a public key.
struct KeyRingFile {
  KeyRing ring;
  std::string text;
};
Result<KeyRingFile> ReadKeyRing(const std::string& path);

}  // namespace cairn
