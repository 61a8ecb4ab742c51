#include "core/database.h"

#include <filesystem>
#include <fstream>

namespace cairn {
namespace {

constexpr char kMagic[] = "SQLite format 3";  // 16 bytes with the terminating zero

// Bytes 16 and 17 of the header, big-endian, 1 for 65536; 0 where the file has none.
uint64_t PageSize(const std::string& path) {
  unsigned char head[18] = {};
  std::ifstream file(path, std::ios::binary);
  if (!file.read(reinterpret_cast<char*>(head), sizeof(head))) return 0;
  const uint64_t page_size = uint64_t{head[16]} << 8 | head[17];
  return page_size == 1 ? 65536 : page_size;
}

}  // namespace

std::string DatabaseUri(const std::string& path) {
  std::string uri = "file:";
  for (const unsigned char c : path) {  // percent-encodes what has a meaning in a URI's path
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02x}", c);
    } else {
      uri += static_cast<char>(c);
    }
  }
  return uri;
}

bool IsSqliteFile(const std::string& path) {
  char head[sizeof(kMagic)] = {};
  std::ifstream file(path, std::ios::binary);
  return file.read(head, sizeof(head)) && std::memcmp(head, kMagic, sizeof(kMagic)) == 0;
}

Status CheckSqliteFile(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
  if (!IsSqliteFile(path)) {
    return MakeError(
        ErrorCode::kCorrupt,
        "{}: not a SQLite database ({} bytes, expected the magic bytes 'SQLite format 3'); is it truncated "
        "or another kind of file?",
        path, std::filesystem::is_directory(path, error) ? 0 : std::filesystem::file_size(path, error));
  }
  const uint64_t page_size = PageSize(path), num_bytes = std::filesystem::file_size(path, error);
  if (page_size == 0 || num_bytes % page_size == 0) return Ok();
  return MakeError(
      ErrorCode::kCorrupt,
      "{}: a truncated SQLite database: {} bytes, which are not whole pages of {}; copy it again", path,
      num_bytes, page_size);
}

Result<SQLite::Database> OpenDatabaseReadOnly(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckSqliteFile(path));
  return WithDatabaseErrors(path, [&]() -> Result<SQLite::Database> {
    SQLite::Database database(DatabaseUri(path) + "?immutable=1", SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    database.execAndGet(
        "SELECT count(*) FROM sqlite_master");  // reads the schema: a damaged header shows here
    return database;
  });
}

Status WriteDatabase(const std::string& path, const std::string& schema,
                     const std::function<Status(SQLite::Database&)>& fill) {
  return ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    return WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database(temporary, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      database.exec("PRAGMA page_size = 4096; PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;");
      database.exec("BEGIN");
      database.exec(schema);
      if (Status status = fill(database); !status.ok()) return status;
      database.exec("COMMIT");
      return Ok();
    });
  });
}

std::string DatabasePath(const SQLite::Database& database) {
  const char* const path = sqlite3_db_filename(database.getHandle(), "main");
  return path != nullptr ? path : "";
}

bool HasTable(SQLite::Database& database, const std::string& table) {
  SQLite::Statement query(database, "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?");
  query.bind(1, table);
  query.executeStep();
  return query.getColumn(0).getInt() > 0;
}

bool HasColumn(SQLite::Database& database, const std::string& table, const std::string& column) {
  SQLite::Statement query(database, "SELECT count(*) FROM pragma_table_info(?) WHERE name = ?");
  query.bind(1, table);
  query.bind(2, column);
  query.executeStep();
  return query.getColumn(0).getInt() > 0;
}

}  // namespace cairn
