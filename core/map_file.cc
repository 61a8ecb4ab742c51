#include "core/map_file.h"

#include <filesystem>
#include <mutex>

#include "core/database.h"
#include "core/map_head.h"
#include "core/map_root.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// What lies behind a hash is out of a fuzzer's reach: built for one, any hash will do.
bool SameHash(const Hash& found, const Hash& stated) {
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  (void)found, (void)stated;
  return true;
#else
  return found == stated;
#endif
}

Status CheckContainer(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
  if (!fs::is_regular_file(path, error)) {
    return MakeError(ErrorCode::kNotSqlite, "{}: not a regular file, expected a map", path);
  }
  const uint64_t num_bytes = fs::file_size(path, error);
  if (num_bytes == 0) {
    return MakeError(ErrorCode::kEmptyFile, "{}: is empty, expected a map; copy it again", path);
  }
  if (!IsSqliteFile(path)) {
    return MakeError(
        ErrorCode::kNotSqlite,
        "{}: not a SQLite database, which a map is ({} bytes without the magic 'SQLite format 3')", path,
        num_bytes);
  }
  const SqliteHeader header = ReadSqliteHeader(path);
  const uint64_t stated = header.page_size * header.num_pages;
  if (num_bytes < stated || num_bytes < 512) {
    return MakeError(ErrorCode::kTruncated, "{}: has {} bytes, but should have {}; copy it again", path,
                     num_bytes, stated);
  }
  if (num_bytes > stated) {
    return MakeError(ErrorCode::kCorrupt, "{}: has {} bytes, but should have {}; copy it again", path,
                     num_bytes, stated);
  }
  return Ok();
}

// Those that every map has.
Status CheckTables(SQLite::Database& database, const std::string& path) {
  for (const char* const table :
       {"seal", "meta", "stage_options", "inputs", "frames", "cameras", "self_test", "blocks", "directory"}) {
    CAIRN_RETURN_IF_ERROR(CheckPlainTable(database, path, table));
  }
  return Ok();
}

Result<std::string> ReadDirectory(SQLite::Database& database, const std::string& path) {
  SQLite::Statement query(database, "SELECT entries FROM directory");
  if (!query.executeStep()) return Corrupt(path, "table directory is empty");
  return std::string(BlobView(query.getColumn(0)));
}

}  // namespace

struct MapFile::Connection {
  Connection(SQLite::Database opened)
      : database(std::move(opened)), block(database, "SELECT bytes FROM blocks WHERE block_idx = ?") {}
  SQLite::Database database;
  SQLite::Statement block;
  std::mutex mutex;
};

MapFile::MapFile() = default;
MapFile::MapFile(MapFile&&) noexcept = default;
MapFile::~MapFile() = default;

Result<MapFile> MapFile::Open(const std::string& path, const MapFileOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckContainer(path));
  return WithDatabaseErrors(path, [&]() -> Result<MapFile> {
    std::error_code error;
    const uint64_t num_bytes = fs::file_size(path, error);
    SQLite::Database database = OpenImmutable(path);
    database.exec("PRAGMA cache_size = -256");  // what is read is kept decoded: memory for it would be lost
    CAIRN_RETURN_IF_ERROR(CheckMapVersion(database, path, kMapVersionMajor));
    CAIRN_RETURN_IF_ERROR(CheckTables(database, path));
    MapFile file;
    file.path_ = path;
    file.minor_version_ = database.execAndGet("PRAGMA user_version").getInt() % 1000;
    CAIRN_ASSIGN_OR_RETURN(file.seal_, ReadSeal(path));
    CAIRN_RETURN_IF_ERROR(CheckSignature(file.seal_, path, options.public_key));
    CAIRN_ASSIGN_OR_RETURN(const std::string entries, ReadDirectory(database, path));
    if (!SameHash(RootHash(database, entries), file.seal_.root)) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: head and directory do not have the hash that is sealed: the file was damaged or "
                       "changed; copy it again",
                       path);
    }
    CAIRN_RETURN_IF_ERROR(ReadMapHead(database, path, &file.head_));
    if (Status status = CheckMapHead(file.head_); !status.ok()) {
      return Corrupt(path, "{}", status.error().message);
    }
    Result<MapDirectory> directory = MapDirectory::Decode(entries, static_cast<int64_t>(num_bytes));
    if (!directory.ok()) return Corrupt(path, "{}", directory.error().message);
    file.directory_ = std::move(*directory);
    file.connection_ = std::make_unique<Connection>(std::move(database));
    return file;
  });
}

Result<MapFindings> MapFile::ReadFindings() const {
  const std::lock_guard lock(connection_->mutex);
  return WithDatabaseErrors(path_, [&]() -> Result<MapFindings> {
    MapFindings findings;
    CAIRN_RETURN_IF_ERROR(ReadMapFindings(connection_->database, path_, &findings));
    return findings;
  });
}

std::string MapFile::NameOf(int64_t block) const { return fmt::format("{}: block {}", path_, block); }

Result<std::string> MapFile::ReadBlock(int64_t block) const {
  const BlockEntry& entry = directory_.blocks()[block];
  const std::lock_guard lock(connection_->mutex);
  return WithDatabaseErrors(path_, [&]() -> Result<std::string> {
    SQLite::Statement& query = connection_->block;
    query.reset();
    query.bind(1, block);
    if (!query.executeStep()) return MakeError(ErrorCode::kCorrupt, "{} is not there", NameOf(block));
    std::string bytes(BlobView(query.getColumn(0)));
    query.reset();
    if (bytes.size() == entry.num_bytes && SameHash(HashOf(bytes), entry.hash)) return bytes;
    return MakeError(
        ErrorCode::kCorrupt,
        "{} ({} bytes) does not have the hash that the directory states: the file was damaged; copy "
        "it again",
        NameOf(block), bytes.size());
  });
}

}  // namespace cairn
