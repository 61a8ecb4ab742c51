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
// Some 250 tables and indices, each of which takes memory in proportion to its text.
constexpr int64_t kMaxSchemaSteps = 2'000;
constexpr int kMaxSqlBytes = 8192;
constexpr int kMaxNumColumns = 64;
constexpr int kMaxDefaultBytes = 100;
constexpr int64_t kSmallFileBytes = 1'000'000;
// Of a row and its place in its page.
constexpr int64_t kLeastRowBytes = 4;

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

// Throws where a table has columns whose values are not stored.
void CheckStoredColumns(SQLite::Database& database) {
  SQLite::Statement query(database,
                          "SELECT s.name, x.name, x.hidden > 0 FROM sqlite_schema s, "
                          "pragma_table_xinfo(s.name) x WHERE s.type = 'table' AND s.rootpage > 0 "
                          "AND (x.hidden > 0 OR length(x.dflt_value) > ?)");
  query.bind(1, kMaxDefaultBytes);
  if (!query.executeStep()) return;
  throw SQLite::Exception(
      fmt::format(
          "column {} of table {} {}", query.getColumn(1).getString(), query.getColumn(0).getString(),
          query.getColumn(2).getInt() != 0 ? "is generated: it stores no values" : "has a long default"),
      SQLITE_CORRUPT);
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
  sqlite3_limit(handle, SQLITE_LIMIT_SQL_LENGTH, kMaxSqlBytes);
  sqlite3_limit(handle, SQLITE_LIMIT_COLUMN, kMaxNumColumns);
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
  {
    const StepLimit steps(database, kMaxSchemaSteps);
    database.execAndGet("SELECT count(*) FROM sqlite_schema WHERE name = ''");
  }
  const StepLimit steps(database, 100 * kMaxSchemaSteps);
  CheckStoredColumns(database);
}

Status CheckPlainTable(SQLite::Database& database, const std::string& path, const char* table) {
  SQLite::Statement query(
      database,
      "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND rootpage > 0 "
      "AND sql LIKE 'CREATE TABLE%' AND NOT EXISTS "
      "(SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden <> 0)");
  query.bind(1, table);
  if (query.executeStep() && query.getColumn(0).getInt() == 1) return Ok();
  return MakeError(ErrorCode::kCorrupt, "{}: has no plain table '{}'", path, table);
}

void CheckKeys(SQLite::Database& database, const std::string& sql) {
  SQLite::Statement plan(database, "EXPLAIN QUERY PLAN " + sql);
  int num_scans = 0;
  bool is_sorted = false;
  while (plan.executeStep()) {
    const std::string step = plan.getColumn(3).getString();
    if (step.starts_with("SCAN")) ++num_scans;
    if (step.find("TEMP B-TREE") != std::string::npos || step.find("AUTOMATIC") != std::string::npos)
      is_sorted = true;
  }
  // With parameters it is run once for each row that is looked up.
  if (!is_sorted && num_scans <= (plan.getBindParameterCount() > 0 ? 0 : 1)) return;
  throw SQLite::Exception("a table lacks the key by which it is read: " + sql, SQLITE_CORRUPT);
}

LimitedStatement::LimitedStatement(SQLite::Database& database, const std::string& sql)
    : SQLite::Statement((CheckKeys(database, sql), database), sql) {
  const int64_t num_pages = database.execAndGet("PRAGMA page_count").getInt64();
  const int64_t page_size = database.execAndGet("PRAGMA page_size").getInt64();
  num_bytes_left_ = kSmallFileBytes + 2 * num_pages * page_size;
}

bool LimitedStatement::executeStep() {
  if (!SQLite::Statement::executeStep()) return false;
  num_bytes_left_ -= kLeastRowBytes;
  for (int i = 0; i < getColumnCount(); ++i) {
    const SQLite::Column column = getColumn(i);
    if (column.isText() || column.isBlob()) num_bytes_left_ -= column.getBytes();
  }
  if (num_bytes_left_ < 0) throw SQLite::Exception("more bytes than the file has", SQLITE_INTERRUPT);
  return true;
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
