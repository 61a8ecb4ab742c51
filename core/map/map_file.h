#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/seal/map_seal.h"

namespace SQLite {
class Database;
}

namespace cairn {

struct MapFileOptions {
  // Maps without a signature of this key, or of enough keys of this ring, are refused.
  std::optional<KeyRing> public_key;
  // Signatures beside the seal's; none: those of SignaturesPath(path), where the seal's own does not suffice.
  std::optional<SignatureList> signatures = {};
};

// A map file, open read-only and immutable: its head and its directory are read and checked against the seal,
// its blocks when they are asked for.  May be shared between threads.
class MapFile {
 public:
  // Errors: NotFound; EmptyFile; Truncated; NotSqlite; ForeignFile; TooNew (names the writer); TooOld;
  // NotSigned; WrongKey; Corrupt (damaged: head and directory do not have the sealed hash, or are
  // invalid); Io.
  static Result<MapFile> Open(const std::string& path, const MapFileOptions& options);
  MapFile(MapFile&&) noexcept;
  ~MapFile();

  const std::string& path() const { return path_; }
  int64_t num_bytes() const { return num_bytes_; }
  const MapHead& head() const { return head_; }
  const MapDirectory& directory() const { return directory_; }
  const Seal& seal() const { return seal_; }
  // Minor version of the file's format, for people.  Nothing is read differently because of it, since only
  // the hash of the whole file covers it.
  int minor_version() const { return minor_version_; }

  // The bytes of directory().blocks()[block].  Errors: Corrupt (their hash is not the directory's), Io.
  Result<std::string> ReadBlock(int64_t block) const;
  // What the compilation found out, checked against its hash in the head or, for earlier formats, the hash of
  // the file.  Not yet checked with CheckMapFindings.  Errors: Corrupt, Io.
  Result<MapFindings> ReadFindings() const;
  // "PATH: block 7", for messages.
  std::string NameOf(int64_t block) const;

 private:
  struct Connection;
  MapFile();
  // Throws SQLite::Exception.
  Status ReadHead(SQLite::Database& database, const MapFileOptions& options);

  std::string path_;
  int64_t num_bytes_ = 0;
  MapHead head_;
  MapDirectory directory_;
  Seal seal_;
  int minor_version_ = 0;
  std::unique_ptr<Connection> connection_;
};

// Memory that a map's blocks may take when they are decoded, in bytes per byte of the file, beyond a start;
// the largest ratio seen in compiled maps is 20, of a block of stations.
inline constexpr int64_t kMostUnfolding = 64;
constexpr int64_t MaxRowBytes(int64_t num_bytes_of_file) {
  constexpr int64_t kSmallMapBytes = int64_t{64} << 20;
  return kSmallMapBytes + kMostUnfolding * num_bytes_of_file;
}

// All of an open map, as ReadMapRows(path).
Result<MapRows> ReadMapRows(const MapFile& file);

}  // namespace cairn
