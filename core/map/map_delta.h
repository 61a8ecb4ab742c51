#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/seal/map_seal.h"

namespace cairn {

// What a robot that has one map needs to make another, byte for byte: only what differs travels.  Regions
// that did not change cost next to nothing, since their blocks are the same bytes in both files, wherever
// they lie.
//
//   0       16         48         80          88          96          100         104          136 168 232 |
//   magic | old hash | new hash | old bytes | new bytes | old page  | new page  | payload    | public key |
//   signature | name, then
//             BLAKE2b-256 of the whole files     u64         u32         u32        BLAKE2b-256  Ed25519, 0:
//             not signed   the payload
//
// The signature is of bytes 0 to 167.  name: its length (u32), then the map's name.  Payload: a Zstandard
// frame with the old file as its prefix.  Both files are taken as their pages without the first four bytes of
// each but the first, then these as u32 less the page's number: SQLite links the pages of a block by them, so
// without them a block is contiguous, whatever the pages are.
struct MapDelta {
  static constexpr int64_t kMaxMapBytes = int64_t{1} << 30;  // of either map: what Zstandard can look back to

  Hash old_hash = {};
  Hash new_hash = {};
  uint64_t old_num_bytes = 0;
  uint64_t new_num_bytes = 0;
  uint32_t old_page_size = 0;
  uint32_t new_page_size = 0;
  PublicKey public_key = {};
  Signature signature = {};
  std::string map_name;  // of the new map
  std::string payload;

  bool is_signed() const { return public_key != PublicKey() || signature != Signature(); }
};

// Both are whole maps.  With a key, signed.  Same maps, same key and same version of libzstd, same bytes.
// Errors: as MapFile::Open and CheckFileHash; Unsupported (a map of more than kMaxMapBytes); of two signed
// maps what a robot would say (CheckFollows); Corrupt (the key: PublicKeyOf).
Result<MapDelta> MakeMapDelta(const std::string& old_path, const std::string& new_path,
                              const std::optional<SecretKey>& key, bool allow_older = false);

std::string EncodeMapDelta(const MapDelta& delta);
// Reads a delta and checks every byte of it, and its signature: that of `required`, or, without it, of the
// key that it names.  Errors: NotFound, Io, EmptyFile, Truncated, Corrupt, Unsupported (no delta, or of a
// later format), NotSigned (required only), WrongKey.
Result<MapDelta> ReadMapDelta(const std::string& path, const std::optional<PublicKey>& required);

// The bytes of the new map, from those of the old one; the paths are for messages.  Takes memory for both,
// twice. Errors: InvalidArgument (it is not the map that the delta leads from: names both), Corrupt.
Result<std::string> ApplyMapDelta(const MapDelta& delta, const std::string& old_bytes,
                                  const std::string& old_path, const std::string& delta_path);

}  // namespace cairn
