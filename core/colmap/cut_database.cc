#include "core/colmap/cut_database.h"

#include <filesystem>

namespace cairn {

DatabasePart PartOfDatabase(const std::string& path) {
  std::error_code error;
  const uintmax_t num_bytes = std::filesystem::file_size(path, error);
  if (error || !IsSqliteFile(path)) return {};
  const uintmax_t num_logged_bytes = std::filesystem::file_size(path + "-wal", error);
  if (!error && num_logged_bytes > 0) return {num_bytes, 0};
  const SqliteHeader header = ReadSqliteHeader(path);
  return {num_bytes, header.page_size * header.num_pages};
}

std::string CutText(const std::string& path, const DatabasePart& part) {
  return fmt::format("{}: truncated: {} of {} bytes are there", path, part.num_bytes, part.num_bytes_whole);
}

Result<SQLite::Database> OpenCutDatabase(const std::string& path) {
  SQLite::Database database(DatabaseUri(path) + "?immutable=1", SQLite::OPEN_READONLY | SQLite::OPEN_URI);
  const uint64_t num_bytes = PartOfDatabase(path).num_bytes;
  Harden(database, num_bytes);
  // SQLite opens a file that is shorter than its head says only where the schema may be written, as its
  // shell's .recover does.  Nothing is: the connection is for reading.
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_DEFENSIVE, 0, nullptr);
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, nullptr);
  ReadSchema(database);
  LimitSteps(database, num_bytes);
  for (const char* table : {"cameras", "images", "keypoints", "descriptors"}) {
    if (HasTable(database, table)) continue;
    return MakeError(ErrorCode::kCorrupt, "{}: truncated, and not COLMAP's: it has no table {}", path, table);
  }
  return database;
}

std::vector<DatabaseImage> ReadCutDatabaseImages(SQLite::Database& database) {
  std::vector<DatabaseImage> images;
  try {
    LimitedStatement query(database, "SELECT image_id, name, camera_id FROM images ORDER BY image_id");
    while (query.executeStep()) {
      const SQLite::Column id = query.getColumn(0), camera_id = query.getColumn(2);
      if (!id.isInteger() || !query.getColumn(1).isText() || !camera_id.isInteger()) break;
      images.push_back({id.getUInt(), query.getColumn(1).getString(), camera_id.getUInt()});
    }
  } catch (const SQLite::Exception& exception) {  // the first page that is not there
    if (exception.getErrorCode() == SQLITE_NOMEM) throw;
  }
  return images;
}

}  // namespace cairn
