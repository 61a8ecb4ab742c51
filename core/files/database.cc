#include "core/files/database.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <filesystem>

#include "core/files/file.h"
#include "core/files/file_descriptor.h"
#include "core/files/input_file.h"

namespace cairn {
namespace {

constexpr char kMagic[] = "SQLite format 3";  // 16 bytes with the terminating zero

uint64_t BigEndian(std::string_view bytes) {
  uint64_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<uint8_t>(byte);
  return value;
}

// Steps between two checks of how many are left.
constexpr int kStepsPerLook = 1000;
// Some 3000 tables and indices.
constexpr int64_t kMaxSchemaSteps = 20'000;

int CountDown(void* num_left) {
  auto& left = *static_cast<int64_t*>(num_left);
  left -= kStepsPerLook;
  return left <= 0 ? 1 : 0;
}

// 0 where there is none.
uint64_t NumBytes(const std::string& path) {
  std::error_code error;
  const uintmax_t num_bytes = std::filesystem::file_size(path, error);
  return error ? 0 : num_bytes;
}

}  // namespace

SqliteHeader ParseSqliteHeader(std::string_view head) {
  SqliteHeader header;
  if (head.size() >= 18) header.page_size = BigEndian(head.substr(16, 2));
  if (header.page_size == 1) header.page_size = 65536;
  if (head.size() >= 32) header.num_pages = BigEndian(head.substr(28, 4));
  return header;
}

SqliteHeader ReadSqliteHeader(const std::string& path) { return ParseSqliteHeader(ReadHead(path, 32)); }

std::string DatabaseUri(const std::string& path) {
  std::string uri = path.starts_with("//") ? "file://" : "file:";  // what follows two slashes is a host
  for (const unsigned char c : path) {  // percent-encodes characters with a meaning in a URI's path
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02x}", c);
    } else {
      uri += static_cast<char>(c);
    }
  }
  return uri;
}

void Harden(SQLite::Database& database, uint64_t num_bytes) {
  sqlite3* const handle = database.getHandle();
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH,
                static_cast<int>(std::clamp<uint64_t>(num_bytes, 100'000, 1'000'000'000)));
  database.exec("PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0;");
}

void LimitSteps(SQLite::Database& database, uint64_t num_bytes) {
  // A row takes five bytes or more, and about one step for each of its values.
  const uint64_t max_num_steps = 10'000'000 + 16 * num_bytes;
  sqlite3* const handle = database.getHandle();
  if (max_num_steps <= INT_MAX) {
    sqlite3_progress_handler(
        handle, static_cast<int>(max_num_steps), [](void*) { return 1; }, nullptr);
    return;
  }
  // SQLite counts no further; a file with a hole in it may be as large as it likes.  All statements of the
  // connection count together then, and none reads a file more than a few times.  A function that nobody
  // calls keeps the count for as long as the connection lives.
  auto* const num_left =
      new int64_t(static_cast<int64_t>(std::min<uint64_t>(max_num_steps, INT64_MAX / 16)) * 8);
  const int code = sqlite3_create_function_v2(
      handle, "cairn_steps_left", 0, SQLITE_UTF8, num_left,
      [](sqlite3_context* context, int, sqlite3_value**) { sqlite3_result_null(context); }, nullptr, nullptr,
      [](void* count) { delete static_cast<int64_t*>(count); });
  if (code == SQLITE_OK)
    sqlite3_progress_handler(handle, kStepsPerLook, CountDown, num_left);  // else it is deleted
}

StepLimit::StepLimit(SQLite::Database& database, int64_t max_num_steps)
    : handle_(database.getHandle()), num_left_(max_num_steps) {
  sqlite3_progress_handler(handle_, kStepsPerLook, CountDown, &num_left_);
}

StepLimit::~StepLimit() { sqlite3_progress_handler(handle_, 0, nullptr, nullptr); }

void ReadSchema(SQLite::Database& database) {
  const StepLimit steps(database, kMaxSchemaSteps);
  database.execAndGet("SELECT count(*) FROM sqlite_schema WHERE name = ''");
}

SQLite::Database OpenImmutable(const std::string& path) {
  SQLite::Database database(DatabaseUri(path) + "?immutable=1", SQLite::OPEN_READONLY | SQLite::OPEN_URI);
  Harden(database, NumBytes(path));
  ReadSchema(database);
  return database;
}

SQLite::Database OpenPrivate(const std::string& path) {
  // "nolock" would refuse what is in WAL mode, as a copy may be.
  SQLite::Database database(DatabaseUri(path) + "?vfs=unix-none",
                            SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI);
  database.exec("PRAGMA locking_mode = EXCLUSIVE");
  return database;
}

bool IsSqliteFile(const std::string& path) {
  return ReadHead(path, sizeof(kMagic)) == std::string_view(kMagic, sizeof(kMagic));
}

Status CheckSqliteFile(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckInputFile(path));
  if (const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)); file.get() < 0)
    return MakeError(ErrorCode::kIo, "{}: cannot be read: {}", path, std::strerror(errno));
  if (!IsSqliteFile(path)) {
    return MakeError(
        ErrorCode::kCorrupt,
        "{}: not a SQLite database ({} bytes, expected the magic bytes 'SQLite format 3'); is it truncated "
        "or another kind of file?",
        path, NumBytes(path));
  }
  const uint64_t page_size = ReadSqliteHeader(path).page_size;
  const uint64_t num_bytes = NumBytes(path);
  if (page_size == 0 || num_bytes % page_size == 0) return Ok();
  return MakeError(
      ErrorCode::kCorrupt,
      "{}: a truncated SQLite database: {} bytes, not a multiple of the page size {}; copy it again", path,
      num_bytes, page_size);
}

Result<SQLite::Database> OpenDatabaseReadOnly(const std::string& path) {
  CAIRN_RETURN_IF_ERROR(CheckSqliteFile(path));
  return WithDatabaseErrors(path, [&]() -> Result<SQLite::Database> {
    SQLite::Database database = OpenImmutable(path);
    LimitSteps(database, NumBytes(path));
    return database;
  });
}

Status WriteDatabase(const std::string& path, const std::string& schema,
                     const std::function<Status(SQLite::Database&)>& fill) {
  return ReplaceFileAtomically(path, [&](const std::string& temporary) -> Status {
    return WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database = OpenPrivate(temporary);
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
