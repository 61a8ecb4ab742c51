#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>

#include <SQLiteCpp/Backup.h>

#include "core/base/no_throw.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/files/file_lock.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyTimeoutMs = 5000;

struct Table {
  const char* name;
  std::vector<const char*> columns;
};

// What is read; every version of COLMAP's schema since 3.0 has it.  Other parts are ignored: the columns
// images.prior_* (to 3.9), the tables pose_priors (3.10), rigs, rig_sensors, frames and frame_data (3.12),
// the column descriptors.type (4.0).
const std::vector<Table>& ReadTables() {
  static const std::vector<Table> kTables = {
      {"cameras", {"camera_id", "model", "width", "height", "params", "prior_focal_length"}},
      {"images", {"image_id", "name", "camera_id"}},
      {"keypoints", {"image_id", "rows", "cols", "data"}},
      {"descriptors", {"image_id", "rows", "cols", "data"}},
      {"two_view_geometries", {"pair_id", "rows", "cols", "data", "config"}}};
  return kTables;
}

std::string TableNames(SQLite::Database& database) {
  std::string names;
  SQLite::Statement query(database, "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name");
  while (query.executeStep()) names += (names.empty() ? "" : ", ") + query.getColumn(0).getString();
  return names.empty() ? "none" : names;
}

// Features are read an image at a time, and may be kept: pages of a hostile file belong to many images at
// once. The length of a blob stands in its row, so that no blob is read here.
Status CheckFeatureBytes(SQLite::Database& database, const std::string& path, uint64_t num_bytes) {
  for (const char* table : {"keypoints", "descriptors"}) {
    const double sum =
        database
            .execAndGet(fmt::format("SELECT total(length(data)) FROM {} WHERE typeof(data) = 'blob'", table))
            .getDouble();
    if (sum > static_cast<double>(num_bytes)) {
      return MakeError(
          ErrorCode::kCorrupt,
          "{}: table {} shows {:.0f} bytes, but the file has {}: it is damaged, or made to stall "
          "its readers; get it again from its source",
          path, table, sum, num_bytes);
    }
  }
  return Ok();
}

Status CheckSchema(SQLite::Database& database, const std::string& path) {
  if (!HasTable(database, "images") || !HasTable(database, "keypoints")) {
    return MakeError(
        ErrorCode::kCorrupt,
        "{}: a SQLite database, but not COLMAP's: expected the tables cameras, images, keypoints, "
        "descriptors and two_view_geometries, found {}",
        path, TableNames(database));
  }
  for (const Table& table : ReadTables()) {
    if (!HasTable(database, table.name)) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: a COLMAP database without the table {}; open it once with COLMAP 3.8 or later, "
                       "which brings old databases up to date",
                       path, table.name);
    }
    for (const char* column : table.columns) {
      if (HasColumn(database, table.name, column)) continue;
      return MakeError(ErrorCode::kUnsupported,
                       "{}: table {} has no column {}: a version of COLMAP's database that this program does "
                       "not know (3.x and 4.0 are read)",
                       path, table.name, column);
    }
  }
  return Ok();
}

bool IsInWalMode(const std::string& path) {
  const std::string head =
      ReadHead(path, 20);  // bytes 18 and 19: write and read version, 2 = write-ahead log
  return head.size() == 20 && head[18] == 2 && head[19] == 2;
}

// 0 where there is none.
uint64_t NumBytes(const std::string& path) {
  std::error_code error;
  const uintmax_t num_bytes = fs::file_size(path, error);
  return error ? 0 : num_bytes;
}

bool IsFilled(const std::string& path) { return NumBytes(path) > 0; }

// Opens copies of a database and its write-ahead log in a folder that is removed at once.
SQLite::Database OpenCopy(const std::string& path) {
  std::string name = fs::temp_directory_path() / "cairn-XXXXXX";
  if (mkdtemp(name.data()) == nullptr)
    throw fs::filesystem_error("no folder can be made", name,
                               std::error_code(errno, std::generic_category()));
  const fs::path folder = name;  // new, and so nobody else's
  const std::string copy = (folder / fs::path(path).filename()).string();
  fs::copy_file(path, copy, fs::copy_options::overwrite_existing);
  fs::copy_file(path + "-wal", copy + "-wal", fs::copy_options::overwrite_existing);
  SQLite::Database database = OpenPrivate(copy);
  Harden(database, NumBytes(copy) + NumBytes(copy + "-wal"));
  ReadSchema(database);
  database.exec("PRAGMA wal_checkpoint(TRUNCATE)");
  database.exec("PRAGMA journal_mode = DELETE");
  fs::remove_all(folder);
  return database;
}

// Respects the locks of a program that writes, reads what it has committed to a write-ahead log, and changes
// neither the file nor what lies beside it.
SQLite::Database OpenUnchanged(const std::string& path) {
  if (IsInWalMode(path)) {
    if (!IsFilled(path + "-wal")) return OpenImmutable(path);
    // Without shared memory nobody has it open: its writer died, or somebody copied the two files.
    std::error_code error;
    if (!fs::exists(path + "-shm", error)) return OpenCopy(path);
  }
  // Nobody who writes to it could say so.
  if (!HasRecordLocks(path) && !IsFilled(path + "-journal") && !IsInWalMode(path)) return OpenImmutable(path);
  SQLite::Database database(DatabaseUri(path) + "?mode=ro", SQLite::OPEN_READONLY | SQLite::OPEN_URI,
                            kBusyTimeoutMs);
  Harden(database, NumBytes(path) + NumBytes(path + "-wal"));
  ReadSchema(database);
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  database.exec("BEGIN");  // one snapshot for as long as it is open
  return database;
}

}  // namespace

Result<SQLite::Database> OpenColmapDatabase(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckSqliteFile(path));
  Result<SQLite::Database> result = WithDatabaseErrors(path, [&]() -> Result<SQLite::Database> {
    try {
      SQLite::Database database = OpenUnchanged(path);
      const uint64_t num_bytes = NumBytes(path) + NumBytes(path + "-wal");
      LimitSteps(database, num_bytes);
      CAIRN_RETURN_IF_ERROR(CheckSchema(database, path));
      CAIRN_RETURN_IF_ERROR(CheckFeatureBytes(database, path, num_bytes));
      return database;
    } catch (const fs::filesystem_error& error) {
      if (IsOutOfMemory(error)) throw;
      return MakeError(ErrorCode::kIo, "{}: cannot be copied with its write-ahead log: {}", path,
                       error.what());
    }
  });
  if (result.ok()) return result;
  if (result.error().code == ErrorCode::kBusy) {
    return MakeError(ErrorCode::kBusy,
                     "{}: another program is writing to it (waited {} s); try again when it has ended", path,
                     kBusyTimeoutMs / 1000);
  }
  if (result.error().code == ErrorCode::kIo && IsFilled(path + "-journal")) {
    return MakeError(ErrorCode::kBusy,
                     "{}: {}-journal lies beside it: a program is writing to it or was killed while it did; "
                     "end it, or open the database once with sqlite3 or COLMAP to roll it back",
                     path, path);
  }
  return result;
}

void CopyColmapDatabase(SQLite::Database& source, const std::string& copy_path) {
  SQLite::Database copy = OpenPrivate(copy_path);
  SQLite::Backup(copy, source).executeStep(-1);
  Harden(copy, NumBytes(copy_path));
  copy.exec("PRAGMA journal_mode = DELETE");  // a copy of a database in WAL mode is in WAL mode
  for (const char* column : {"F", "E", "H", "qvec", "tvec"}) {
    if (!HasColumn(copy, "two_view_geometries", column))
      copy.exec(fmt::format("ALTER TABLE two_view_geometries ADD COLUMN {} BLOB", column));
  }
}

}  // namespace cairn
