#include "core/database.h"

#include <filesystem>
#include <fstream>

namespace cairn {
namespace {

constexpr char kMagic[] = "SQLite format 3";  // 16 bytes with the terminating zero

// Percent-encodes what has a meaning in a URI's path.
std::string UriFromPath(const std::string& path) {
  std::string uri = "file:";
  for (const unsigned char c : path) {
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02x}", c);
    } else {
      uri += static_cast<char>(c);
    }
  }
  return uri;
}

}  // namespace

bool IsSqliteFile(const std::string& path) {
  char head[sizeof(kMagic)] = {};
  std::ifstream file(path, std::ios::binary);
  return file.read(head, sizeof(head)) && std::memcmp(head, kMagic, sizeof(kMagic)) == 0;
}

Result<SQLite::Database> OpenDatabaseReadOnly(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
  if (!IsSqliteFile(path)) {
    return MakeError(
        ErrorCode::kCorrupt,
        "{}: not a SQLite database ({} bytes, expected the magic bytes 'SQLite format 3'); is it truncated "
        "or another kind of file?",
        path, std::filesystem::is_directory(path, error) ? 0 : std::filesystem::file_size(path, error));
  }
  return WithDatabaseErrors(path, [&]() -> Result<SQLite::Database> {
    SQLite::Database database(UriFromPath(path) + "?immutable=1", SQLite::OPEN_READONLY | SQLite::OPEN_URI);
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

bool HasTable(SQLite::Database& database, const std::string& table) {
  SQLite::Statement query(database, "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?");
  query.bind(1, table);
  query.executeStep();
  return query.getColumn(0).getInt() > 0;
}

}  // namespace cairn
