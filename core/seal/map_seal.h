#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/blocks/map_blocks.h"
#include "core/seal/key_ring.h"
#include "core/seal/signature_list.h"
#include "core/seal/signing_key.h"

namespace cairn {

// Shows that nobody has changed a map since it was made: 176 bytes at a fixed place in the file, its page 2.
//
//   0            16         48         80            112          176
//   | magic      | root     | file     | public key  | signature  |
//
// root: BLAKE2b over the tables that a robot reads when it opens the map, and over the directory with the
// hash of every block: a reader that has checked root and signature can check each block when it is loaded.
// file: BLAKE2b over all bytes of the file, those of `file` to `signature` taken as zero.  signature: Ed25519
// over magic, root and file; key and signature are zero in a map that nobody has signed.
struct Seal {
  static constexpr size_t kNumBytes = 176;
  Hash root = {};
  Hash file = {};
  PublicKey public_key = {};
  Signature signature = {};

  bool is_signed() const { return public_key != PublicKey() || signature != Signature(); }
};

// BLAKE2b-256 of several parts in turn.
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
// The same with a signature.  Errors: also those of SignBytes.
Status SignFile(const std::string& path, const Hash& root, const SecretKey& key);
// The seal of a map file.  Errors: NotFound, Corrupt.
Result<Seal> ReadSeal(const std::string& path);
// Errors: Corrupt when the bytes of the file do not have the hash that its seal states.
Status CheckFileHash(const std::string& path);
// The bytes that a signature covers: magic, root and file.  Whoever signs them, they are the same.
std::string SignedBytesOf(const Seal& seal);
// Whether the signature is valid and, where keys are required, enough of them have signed, with `others` or
// the signatures beside the file.  Errors: as CheckSignatureOf (core/seal/signature.h).
Status CheckSignature(const Seal& seal, const std::string& path, const std::optional<KeyRing>& required,
                      const std::optional<SignatureList>& others = std::nullopt);

// Writes a signed copy of a map, of this epoch; the old file stays.  Without an epoch: the map's own, or 1
// where it has none.  Returns the epoch.  The copy is opened with the key before it is put in place; same
// map, epoch and key, same bytes.  Errors: as MapFile::Open; InvalidArgument (epoch 0); Corrupt (the map's
// own hash is wrong: an unchecked map is not signed; or the key: PublicKeyOf); as Replacement::Finish.
Result<uint64_t> SignMap(const std::string& path, const SecretKey& key, const std::string& signed_path,
                         std::optional<uint64_t> epoch = std::nullopt);

// Adds this key's signature of a map that is signed to a file of signatures; the map stays as it is.  It is
// checked first: every byte, as SignMap does.  Errors: as MapFile::Open, CheckFileHash and AddSignature;
// NotSigned (the map has no signature in its seal); InvalidArgument (this key's is in its seal); Busy (it is
// being replaced).
Status AddMapSignature(const std::string& path, const SecretKey& key, const std::string& signatures_path);

}  // namespace cairn
