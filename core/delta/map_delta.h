#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/seal/map_seal.h"

namespace cairn {

// What a robot that has one map needs to make another, byte for byte: only the differences are sent.  Regions
// that did not change cost next to nothing, since their blocks are the same bytes in both files, wherever
// they lie; of packed blocks that did change, what did not change of their rows costs nothing (row_delta.h).
//
//   byte   bytes
//      0      15   magic
//     15       1   '1', or '2': the payload has rows
//     16      32   BLAKE2b-256 of the whole old map
//     48      32   BLAKE2b-256 of the whole new map
//     80       8   number of bytes of the old map, u64
//     88       8   number of bytes of the new map, u64
//     96       4   page size of the old map, u32
//    100       4   page size of the new map, u32
//    104      32   BLAKE2b-256 of the name, a zero byte and the payload
//    136      32   public key; 0: not signed
//    168      64   Ed25519 signature of bytes 0 to 167; 0: not signed
//    232           length of the name (u32), the new map's name, then the payload
//
// Payload: where it has rows, their length (u32) and they; then a Zstandard frame with the old file as its
// prefix, behind which stand, where there are rows, the blocks that are made of them.  Both files are taken
// as their pages without the first four bytes of each but the first, then these as u32 less the page's
// number: SQLite links the pages of a block by them, so without them a block is contiguous, whatever the
// pages are.  Where there are rows, 0 less the page's number, the end of a block, is exchanged with 2^31.
struct MapDelta {
  static constexpr int64_t kMaxMapBytes = int64_t{1} << 30;  // of either map: what Zstandard can look back to
  // Larger ones are sent without rows, which take several times a map's bytes in memory.
  static constexpr int64_t kMaxRowMapBytes = int64_t{1} << 26;

  Hash old_hash = {};
  Hash new_hash = {};
  uint64_t old_num_bytes = 0;
  uint64_t new_num_bytes = 0;
  uint32_t old_page_size = 0;
  uint32_t new_page_size = 0;
  PublicKey public_key = {};
  Signature signature = {};
  bool has_rows = false;
  std::string map_name;  // of the new map
  std::string payload;

  bool is_signed() const { return public_key != PublicKey() || signature != Signature(); }
};

// Both are whole maps.  With a key, signed.  Same maps, same key and same version of libzstd, same bytes.
// Errors: as MapFile::Open and CheckFileHash; Unsupported (a map of more than kMaxMapBytes); for two signed
// maps those of CheckFollows, as on a robot; Corrupt (the key: PublicKeyOf).
Result<MapDelta> MakeMapDelta(const std::string& old_path, const std::string& new_path,
                              const std::optional<SecretKey>& key, bool allow_older = false);

std::string EncodeMapDelta(const MapDelta& delta);
// Reads a delta and checks every byte of it, and its signature: that of a key of `required`, or, without it,
// of the key that it names.  One key is enough for any ring, since the delta makes nothing but the map that
// it states, and that one needs as many as the ring wants.  Errors: NotFound, Io, EmptyFile, Truncated,
// Corrupt, Unsupported (not a delta, or of a later format), NotSigned (required only), WrongKey.
Result<MapDelta> ReadMapDelta(const std::string& path, const std::optional<KeyRing>& required);

// The bytes of the new map, from those of the old one, which is read again from `old_path` where the delta
// has rows.  Takes twice the memory of both, and that of the rows.  Errors: InvalidArgument (it is not the
// map that the delta leads from: names both), Corrupt; those of ReadMapRows.
Result<std::string> ApplyMapDelta(const MapDelta& delta, const std::string& old_bytes,
                                  const std::string& old_path, const std::string& delta_path);

}  // namespace cairn
