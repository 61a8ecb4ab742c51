#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace cairn {

using PublicKey = std::array<uint8_t, 32>;
using Signature = std::array<uint8_t, 64>;

// libsodium's: a seed of 32 bytes, then the public key that follows from it.  Overwritten when it
// is destroyed.
struct SecretKey : std::array<uint8_t, 64> {
  SecretKey() : std::array<uint8_t, 64>{} {}
  SecretKey(const SecretKey&) = default;
  SecretKey& operator=(const SecretKey&) = default;
  ~SecretKey();
};

// Keys as hexadecimal text in files of one line.  A new pair, from the system's random numbers.
struct KeyPair {
  PublicKey public_key;
  SecretKey secret_key;
};
KeyPair MakeKeyPair();
// Writes `path` (only its owner may read it) and `path`.pub: both or none.
// Errors: InvalidArgument when one exists; as Replacement::Finish.
Status WriteKeyPair(const KeyPair& keys, const std::string& path);

// A key that signs.  Errors: NotFound; Io; InvalidArgument (not a regular file; group or others may read it;
// a public key); Corrupt (not a key, or as PublicKeyOf).
Result<SecretKey> ReadSecretKey(const std::string& path);
// Errors: NotFound; Io; InvalidArgument (not a regular file, or a secret key); Corrupt.
Result<PublicKey> ReadPublicKey(const std::string& path);
// The same of a file's text without white space at its end.
Result<PublicKey> PublicKeyOfText(std::string_view text, const std::string& path);

// The public key of a secret one, which follows from its seed.  Errors: Corrupt where the key states another
// one: it is damaged, and anyone with a signature by each of the two could sign too.
Result<PublicKey> PublicKeyOf(const SecretKey& key);

std::string HexOf(const PublicKey& key);

}  // namespace cairn
