#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/map_blocks.h"

namespace cairn {

// What makes a map one that nobody changed since: 176 bytes at a fixed place in the file, its page 2.
//
//   0            16         48         80            112          176
//   | magic      | root     | file     | public key  | signature  |
//
// root: BLAKE2b over the tables that a robot reads when it opens the map, and over the directory with the
// hash of every block: whoever has checked root and signature can check a block when it is loaded.  file:
// BLAKE2b over all bytes of the file, those of `file` to `signature` taken as zero.  signature: Ed25519 over
// magic, root and file; key and signature are zero in a map that nobody has signed.
using PublicKey = std::array<uint8_t, 32>;
using SecretKey = std::array<uint8_t, 64>;  // libsodium's: seed and public key
using Signature = std::array<uint8_t, 64>;

struct Seal {
  static constexpr size_t kNumBytes = 176;
  Hash root = {};
  Hash file = {};
  PublicKey public_key = {};
  Signature signature = {};

  bool is_signed() const { return public_key != PublicKey() || signature != Signature(); }
};

// BLAKE2b-256 of parts one after the other.
class Hasher {
 public:
  Hasher();
  void Add(std::string_view bytes);
  void Add(uint64_t number);  // 8 bytes, little-endian
  Hash Finish();

 private:
  alignas(64) std::array<uint8_t, 384> state_;  // crypto_generichash_state
};
Hash HashOf(std::string_view bytes);

std::string EncodeSeal(const Seal& seal);
// Errors: Corrupt when it does not have the magic and the length.
Result<Seal> DecodeSeal(std::string_view bytes);

// Writes root and file hash into a map file whose seal has the magic only.  Errors: Io, Corrupt (no place for
// a seal in page 2).
Status SealFile(const std::string& path, const Hash& root);
// The seal of a map file.  Errors: NotFound, Corrupt.
Result<Seal> ReadSeal(const std::string& path);
// Errors: Corrupt when the bytes of the file do not have the hash that its seal states.
Status CheckFileHash(const std::string& path);
// Whether the signature is that of `required`, or, without it, of the key that the seal has.
// Errors: NotSigned (required only), WrongKey.
Status CheckSignature(const Seal& seal, const std::string& path, const std::optional<PublicKey>& required);

// Keys as hexadecimal text in files of one line.  A new pair, from the system's random numbers.
struct KeyPair {
  PublicKey public_key;
  SecretKey secret_key;
};
KeyPair MakeKeyPair();
// Writes `path` (only its owner may read it) and `path`.pub.  Errors: InvalidArgument when one exists; Io.
Status WriteKeyPair(const KeyPair& keys, const std::string& path);
// Errors: NotFound, Corrupt.
Result<SecretKey> ReadSecretKey(const std::string& path);
Result<PublicKey> ReadPublicKey(const std::string& path);
std::string HexOf(const PublicKey& key);

// Writes a signed copy of a map; the old file stays.  Errors: as MapFile::Open; Corrupt (the map's own hash
// is wrong: what nobody has checked is not signed); Io.
Status SignMap(const std::string& path, const SecretKey& key, const std::string& signed_path);

}  // namespace cairn
