#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "core/base/error.h"
#include "core/files/file.h"

namespace cairn {

// Runs `body` (returning Status or Result<T>) and turns SQLite's exceptions into errors that name the file.
template <typename Body>
auto WithDatabaseErrors(const std::string& path, Body&& body) -> std::invoke_result_t<Body> {
  try {
    return body();
  } catch (const SQLite::Exception& exception) {
    const int code = exception.getErrorCode();
    const ErrorCode error =
        code == SQLITE_BUSY || code == SQLITE_LOCKED ? ErrorCode::kBusy
        : code == SQLITE_FULL                        ? ErrorCode::kDiskFull
        : code == SQLITE_NOMEM                       ? ErrorCode::kNoMemory
        : code == SQLITE_IOERR || code == SQLITE_READONLY || code == SQLITE_CANTOPEN || code == SQLITE_PERM
            ? ErrorCode::kIo
            : ErrorCode::kCorrupt;
    if (code == SQLITE_INTERRUPT) {
      return MakeError(error,
                       "{}: shows more rows than a file of its size can hold: it is damaged, or made to "
                       "stall its readers; get it again from its source",
                       path);
    }
    return MakeError(error, "{}: SQLite says: {}", path, exception.what());
  }
}

// What the header of a SQLite database states; 0 for fields beyond the end of `head`.
struct SqliteHeader {
  uint64_t page_size = 0;  // bytes 16, 17
  uint64_t num_pages = 0;  // bytes 28 to 31
};
// `head`: the file's first bytes.
SqliteHeader ParseSqliteHeader(std::string_view head);
SqliteHeader ReadSqliteHeader(const std::string& path);

// The file as SQLite's URI, to which "?mode=ro" or the like can be appended.
std::string DatabaseUri(const std::string& path);

// Makes a connection safe for a file that somebody else wrote: SQLite runs none of its views and triggers,
// calls no function of its schema that could do harm, checks its cells, maps none of it into memory, parses
// no long text (8 KiB) of its schema, and allocates no value longer than the `num_bytes` of the file (at
// least 100 kB).  Every connection to a file that this process has not written itself is made safe first:
// OpenImmutable, OpenDatabaseReadOnly and OpenColmapDatabase do it.  Throws SQLite::Exception: call it inside
// WithDatabaseErrors.
void Harden(SQLite::Database& database, uint64_t num_bytes);

// Ends each statement that takes more steps than reading all of a file of `num_bytes` can need: a file whose
// pages refer to each other can show rows without end.  The steps of a statement add up over its runs, so do
// not use it for a statement that is kept for the program's life.  Such a statement fails as
// SQLite's "interrupted".
void LimitSteps(SQLite::Database& database, uint64_t num_bytes);

// While it lives, all statements on a connection together may take this many steps of SQLite's virtual
// machine, then they end with SQLITE_INTERRUPT: pages of a hostile file may lead to one another, so that few
// bytes show more rows than can ever be read.  (LimitSteps is for connections that live for one reading.)
class StepLimit {
 public:
  StepLimit(SQLite::Database& database, int64_t max_num_steps);
  ~StepLimit();
  StepLimit(const StepLimit&) = delete;
  StepLimit& operator=(const StepLimit&) = delete;

 private:
  sqlite3* handle_;
  int64_t num_left_;
};

// Reads a connection's schema, which SQLite would otherwise do when it is first needed, within few steps: it
// parses every row.  A table whose values are not all stored in its rows is refused: generated columns, and
// columns with long defaults, by which a row of five bytes shows any number of them.  Throws
// SQLite::Exception.
void ReadSchema(SQLite::Database& database);

// Hardened, its schema read.  Takes no lock, looks for no -wal or -shm beside it, and is wrong if somebody
// writes meanwhile.  Throws SQLite::Exception: call it inside WithDatabaseErrors.
SQLite::Database OpenImmutable(const std::string& path);

// Opens a file that this process alone knows of, such as one that is renamed when it is whole, to be written;
// makes it if it is not there.  It is not locked: a file system may have no locks, or slow ones.  Throws
// SQLite::Exception.
SQLite::Database OpenPrivate(const std::string& path);

// Errors: NotFound, Corrupt (empty, not a regular file, without SQLite's magic bytes, or not whole pages).
Status CheckSqliteFile(const std::string& path);

// Opens an existing database immutable, hardened and with limited steps, and checks it.
// Errors: NotFound, Corrupt (empty, truncated, or not SQLite).
Result<SQLite::Database> OpenDatabaseReadOnly(const std::string& path);

// Writes a new database file: page size 4096, no journal (the file is not visible before it is whole),
// `schema` executed, `fill` run in one transaction, then as WriteFileAtomically.  Same calls, same bytes.
Status WriteDatabase(const std::string& path, const std::string& schema,
                     const std::function<Status(SQLite::Database&)>& fill);

// Whether the file starts with SQLite's magic bytes.
bool IsSqliteFile(const std::string& path);

// The file's absolute path, for messages (getFilename() is the URI that it was opened with).
std::string DatabasePath(const SQLite::Database& database);

// Errors: Corrupt unless it is a table that stores its rows: no view, no virtual table, no generated columns.
Status CheckPlainTable(SQLite::Database& database, const std::string& path, const char* table);

// A query of a file that somebody else wrote.  Pages of a hostile file belong to many tables and rows at
// once, and so few bytes show gigabytes: all rows together, however often it is run, may show at most twice
// what the file holds (and 1 MB).  Nor is a query run which keeps all rows before the first, to sort them, or
// which looks through a table for each row that it looks up: both for want of the key that the table has
// where it was written as it should be.  (A statement that is kept for the program's life is checked by
// CheckKeys alone.)  Constructor and executeStep throw SQLite::Exception.
class LimitedStatement : public SQLite::Statement {
 public:
  LimitedStatement(SQLite::Database& database, const std::string& sql);
  bool executeStep();  // in place of Statement's

 private:
  int64_t num_bytes_left_;
};

// Throws SQLite::Exception where a query needs a key that its tables do not have.
void CheckKeys(SQLite::Database& database, const std::string& sql);

bool HasTable(SQLite::Database& database, const std::string& table);
bool HasColumn(SQLite::Database& database, const std::string& table, const std::string& column);

// Binds a vector's elements as a blob, which is not copied: the vector has to outlive the statement's step.
template <typename T>
void BindVector(SQLite::Statement& statement, int index, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  static const T kNone{};  // a blob of no bytes still needs an address, or it is NULL
  statement.bindNoCopy(index, values.empty() ? &kNone : values.data(),
                       static_cast<int>(values.size() * sizeof(T)));
}

// A blob as a vector of T.  Errors: Corrupt when its length is not a multiple of sizeof(T).  `what` names it.
template <typename T>
Result<std::vector<T>> BlobToVector(const SQLite::Column& column, const std::string& what) {
  static_assert(std::is_trivially_copyable_v<T>);
  const size_t num_bytes = column.getBytes();
  if (num_bytes % sizeof(T) != 0) {
    return MakeError(ErrorCode::kCorrupt, "{}: a blob of {} bytes is not a multiple of {}", what, num_bytes,
                     sizeof(T));
  }
  std::vector<T> values(num_bytes / sizeof(T));
  if (num_bytes > 0) std::memcpy(values.data(), column.getBlob(), num_bytes);
  return values;
}

}  // namespace cairn
