#include "core/files/database.h"

#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/colmap_database.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A database of another program, made by `sql`.
class HardenedDatabase : public testing::Test {
 protected:
  HardenedDatabase() : folder_(fmt::format("{}/database_test_{}", testing::TempDir(), getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~HardenedDatabase() override { fs::remove_all(folder_); }

  std::string Write(const std::string& sql) {
    const std::string path = (folder_ / "foreign.db").string();
    fs::remove(path);
    SQLite::Database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(sql);
    return path;
  }

  fs::path folder_;
};

TEST_F(HardenedDatabase, ViewsAreNotRun) {
  const std::string path =
      Write("CREATE TABLE t (x); INSERT INTO t VALUES (1); CREATE VIEW v AS SELECT 2 AS x");
  for (const bool checked : {false, true}) {
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database = checked ? OpenDatabaseReadOnly(path).value() : OpenImmutable(path);
      EXPECT_EQ(database.execAndGet("SELECT x FROM t").getInt(), 1);
      database.execAndGet("SELECT x FROM v");
      return Ok();
    });
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.error().message, HasSubstr("view"));
  }
}

// A harmful schema would call the functions of the program: here, of each connection when it is opened.
TEST_F(HardenedDatabase, FunctionsOfTheProgramAreNotCalledByTheSchema) {
  const auto add_function = [](sqlite3* database, char**, const void*) {
    return sqlite3_create_function(
        database, "harm", 1, SQLITE_UTF8 | SQLITE_DETERMINISTIC, nullptr,
        [](sqlite3_context* context, int, sqlite3_value**) { sqlite3_result_int(context, 7); }, nullptr,
        nullptr);
  };
  int (*const entry)(sqlite3*, char**, const void*) = add_function;
  sqlite3_auto_extension(reinterpret_cast<void (*)()>(entry));
  const std::string path = Write("CREATE TABLE t (x)");
  {
    SQLite::Database writer(path, SQLite::OPEN_READWRITE);
    writer.exec("CREATE TABLE u (x, y AS (harm(x))); INSERT INTO u VALUES (1)");
    EXPECT_EQ(writer.execAndGet("SELECT y FROM u").getInt(), 7);
  }
  const Status status = WithDatabaseErrors(path, [&]() -> Status {
    SQLite::Database database = OpenImmutable(path);
    database.execAndGet("SELECT y FROM u");
    return Ok();
  });
  sqlite3_cancel_auto_extension(reinterpret_cast<void (*)()>(entry));
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("unsafe use of harm"));
}

TEST_F(HardenedDatabase, TriggersOfAForeignDatabaseDoNotFireInACopyOfIt) {
  const std::string path =
      Write(std::string(kColmapSchema) +
            "; CREATE TABLE noted (x);"
            "CREATE TRIGGER t AFTER INSERT ON cameras BEGIN INSERT INTO noted VALUES (1); END");
  SQLite::Database database(path, SQLite::OPEN_READWRITE);
  Harden(database, 0);
  database.exec("INSERT INTO cameras VALUES (1, 0, 1, 1, x'', 0)");
  EXPECT_EQ(database.execAndGet("SELECT count(*) FROM cameras").getInt(), 1);
  EXPECT_EQ(database.execAndGet("SELECT count(*) FROM noted").getInt(), 0);
}

TEST_F(HardenedDatabase, ValuesAreNoLongerThanTheFile) {
  const std::string path = Write("CREATE TABLE t (x); INSERT INTO t VALUES (zeroblob(120000))");
  const auto num_bytes = static_cast<int>(fs::file_size(path));
  SQLite::Database database = OpenDatabaseReadOnly(path).value();
  EXPECT_EQ(database.execAndGet("SELECT length(x) FROM t").getInt(), 120'000);
  EXPECT_EQ(sqlite3_limit(database.getHandle(), SQLITE_LIMIT_LENGTH, -1), num_bytes);
  EXPECT_THROW(database.execAndGet(fmt::format("SELECT length(zeroblob({}))", num_bytes + 1)),
               SQLite::Exception);
}

// Of a file of up to 100 kB, values of 100 kB; SQLite has none of more than 10^9 bytes.
TEST_F(HardenedDatabase, ValuesHaveALimitWhateverTheFilesSize) {
  const std::string path = Write("CREATE TABLE t (x)");
  for (const auto& [num_bytes, most] :
       {std::pair(uint64_t{0}, 100'000), std::pair(uint64_t{100'000}, 100'000),
        std::pair(uint64_t{100'001}, 100'001), std::pair(uint64_t{1} << 40, 1'000'000'000)}) {
    SQLite::Database database(path);
    Harden(database, num_bytes);
    EXPECT_EQ(sqlite3_limit(database.getHandle(), SQLITE_LIMIT_LENGTH, -1), most);
  }
}

TEST_F(HardenedDatabase, ColmapDatabasesAreHardenedHoweverTheyAreOpened) {
  const std::string sql = std::string(kColmapSchema) + "; CREATE VIEW v AS SELECT 2 AS x";
  const auto expect_hardened = [](const std::string& path) {
    SQLite::Database database = OpenColmapDatabase(path).value();
    EXPECT_THROW(database.execAndGet("SELECT x FROM v"), SQLite::Exception) << path;
  };
  expect_hardened(Write(sql));                                 // with a journal
  expect_hardened(Write("PRAGMA journal_mode = WAL;" + sql));  // whose log is empty
  // A log without its shared memory, as copied from a running program: read by way of a copy.
  const std::string path = Write("PRAGMA journal_mode = WAL;" + sql);
  SQLite::Database writer(path, SQLite::OPEN_READWRITE);
  writer.exec("INSERT INTO cameras VALUES (1, 0, 1, 1, x'', 0)");
  const std::string copy = (folder_ / "copied.db").string();
  fs::copy_file(path, copy);
  fs::copy_file(path + "-wal", copy + "-wal");
  ASSERT_GT(fs::file_size(copy + "-wal"), 0u);
  expect_hardened(copy);
}

// Two interior pages that name each other's children show more rows than the file has bytes.  The same by SQL
// that is ours: a join of the table with itself.
TEST_F(HardenedDatabase, StatementsEndThatTakeMoreStepsThanTheFileCanNeed) {
  std::string sql = "CREATE TABLE t (x); INSERT INTO t VALUES (1)";
  for (int i = 0; i < 12; ++i) sql += "; INSERT INTO t SELECT * FROM t";  // 4096 rows
  // Longer files may take more steps, and no file any number: 10 million and 16 for each byte.
  for (const char* padding : {"", "; CREATE TABLE p (x); INSERT INTO p VALUES (zeroblob(1000000))"}) {
    const std::string path = Write(sql + padding);
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      SQLite::Database database = OpenDatabaseReadOnly(path).value();
      EXPECT_EQ(database.execAndGet("SELECT count(*) FROM t").getInt(), 4096);
      database.execAndGet("SELECT sum(a.x + b.x) FROM t a, t b");  // 16,777,216 rows
      return Ok();
    });
    ASSERT_FALSE(status.ok()) << padding;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(status.error().message, HasSubstr("shows more rows than a file of its size can hold"));
  }
  const std::string path = Write(sql);
  // A statement that is kept is not limited: a robot reads blocks for months.
  SQLite::Database kept = OpenImmutable(path);
  EXPECT_EQ(kept.execAndGet("SELECT count(*) FROM t a, t b").getInt(), 16'777'216);
}

// The steps that SQLite says a statement took, on a connection without a limit.
int NumSteps(const std::string& path, const std::string& sql) {
  SQLite::Database database = OpenImmutable(path);
  sqlite3_stmt* statement = nullptr;
  EXPECT_EQ(sqlite3_prepare_v2(database.getHandle(), sql.c_str(), -1, &statement, nullptr), SQLITE_OK);
  while (sqlite3_step(statement) == SQLITE_ROW) {
  }
  const int num_steps = sqlite3_stmt_status(statement, SQLITE_STMTSTATUS_VM_STEP, 0);
  sqlite3_finalize(statement);
  return num_steps;
}

// 10 million, and 16 for each byte of the file, up to a hundredth.
TEST_F(HardenedDatabase, LongerFilesMayTakeMoreSteps) {
  const auto query = [](int num_rows) {
    return fmt::format(
        "WITH RECURSIVE c (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < {}) SELECT max(i) FROM c",
        num_rows);
  };
  for (const int num_bytes : {1000, 400'000}) {
    const std::string path =
        Write(fmt::format("CREATE TABLE p (x); INSERT INTO p VALUES (zeroblob({}))", num_bytes));
    const auto most = static_cast<double>(10'000'000 + 16 * fs::file_size(path));
    const double steps_per_row = (NumSteps(path, query(2000)) - NumSteps(path, query(1000))) / 1000.0;
    for (const auto& [part, is_allowed] : {std::pair(0.99, true), std::pair(1.01, false)}) {
      const auto num_rows = static_cast<int>(part * most / steps_per_row);
      const Status status = WithDatabaseErrors(path, [&]() -> Status {
        SQLite::Database database = OpenDatabaseReadOnly(path).value();
        EXPECT_EQ(database.execAndGet(query(num_rows)).getInt(), num_rows);
        return Ok();
      });
      EXPECT_EQ(status.ok(), is_allowed) << part << " of " << most;
    }
  }
}

// All statements of the connection together; what is left is looked at after each thousand steps.
TEST_F(HardenedDatabase, StepLimitIsOfAllStatementsWhileItLives) {
  std::string sql = "CREATE TABLE t (x); INSERT INTO t VALUES (1)";
  for (int i = 0; i < 12; ++i) sql += "; INSERT INTO t SELECT * FROM t";
  const std::string path = Write(sql);
  const std::string query = "SELECT sum(x) FROM t";
  const int num_steps = NumSteps(path, query);
  ASSERT_GT(num_steps, 4096);
  SQLite::Database database = OpenImmutable(path);
  for (const int num_runs : {1, 4}) {
    const StepLimit steps(database, num_runs * num_steps + 1000);
    for (int run = 0; run < num_runs; ++run)
      EXPECT_EQ(database.execAndGet(query).getInt(), 4096) << run << " of " << num_runs;
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      database.execAndGet(query);
      return Ok();
    });
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.error().message, HasSubstr("shows more rows than a file of its size can hold"));
  }
  EXPECT_EQ(database.execAndGet("SELECT count(*) FROM t a, t b").getInt(), 16'777'216);
}

// A file with a hole in it may be as large as it likes: SQLite counts no further than to 2^31 - 1.
TEST_F(HardenedDatabase, FilesOfAnySizeAreRead) {
  std::string sql = "CREATE TABLE t (x); INSERT INTO t VALUES (1)";
  for (int i = 0; i < 12; ++i) sql += "; INSERT INTO t SELECT * FROM t";
  const std::string path = Write(sql);
  for (const uint64_t num_bytes : {uint64_t{133'592'727}, uint64_t{133'592'728}, uint64_t{1} << 59}) {
    SQLite::Database database = OpenImmutable(path);
    LimitSteps(database, num_bytes);
    EXPECT_EQ(database.execAndGet("SELECT count(*) FROM t a, t b").getInt(), 16'777'216) << num_bytes;
  }
}

TEST_F(HardenedDatabase, StatementsOfColmapsDatabasesEndToo) {
  std::string sql = std::string(kColmapSchema) + "; CREATE TABLE t (x); INSERT INTO t VALUES (1)";
  for (int i = 0; i < 12; ++i) sql += "; INSERT INTO t SELECT * FROM t";
  for (const char* mode : {"", "PRAGMA journal_mode = WAL;"}) {
    const std::string path = Write(mode + sql);
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      OpenColmapDatabase(path).value().execAndGet("SELECT sum(a.x + b.x) FROM t a, t b");
      return Ok();
    });
    ASSERT_FALSE(status.ok()) << mode;
    EXPECT_THAT(status.error().message, HasSubstr("shows more rows than a file of its size can hold"));
  }
}

TEST_F(HardenedDatabase, HeadersSayHowLongTheFileIs) {
  const std::string path = Write("PRAGMA page_size = 1024; CREATE TABLE t (x); CREATE TABLE u (x)");
  const std::string bytes = ReadFile(path).value();
  EXPECT_EQ(ReadSqliteHeader(path).page_size, 1024u);
  EXPECT_EQ(ReadSqliteHeader(path).num_pages, 3u);
  for (const auto& [size, page_size, num_pages] :
       {std::tuple(17, 0u, 0u), std::tuple(18, 1024u, 0u), std::tuple(31, 1024u, 0u),
        std::tuple(32, 1024u, 3u), std::tuple(100, 1024u, 3u)}) {
    const SqliteHeader header =
        ParseSqliteHeader(std::string_view(bytes).substr(0, static_cast<size_t>(size)));
    EXPECT_EQ(header.page_size, page_size) << size;
    EXPECT_EQ(header.num_pages, num_pages) << size;
  }
}

// Two bytes have no room for it: a 1 stands for it.
TEST_F(HardenedDatabase, LargestPagesAreOf65536Bytes) {
  const std::string path = Write("PRAGMA page_size = 65536; CREATE TABLE t (x)");
  EXPECT_EQ(ReadSqliteHeader(path).page_size, 65536u);
  EXPECT_EQ(ReadSqliteHeader(path).num_pages, 2u);
  EXPECT_TRUE(OpenDatabaseReadOnly(path).ok());
  fs::resize_file(path, 65536 + 32768);
  EXPECT_THAT(OpenDatabaseReadOnly(path).error().message,
              HasSubstr("98304 bytes, not a multiple of the page size 65536"));
}

TEST_F(HardenedDatabase, NamesOfFilesAreNoOptionsOfAUri) {
  EXPECT_EQ(DatabaseUri("/a b/k?mode=rw#c%2e.db"), "file:/a b/k%3fmode=rw%23c%252e.db");
}

TEST_F(HardenedDatabase, PipesAndDevicesAreNoDatabases) {
  const std::string pipe = (folder_ / "pipe.db").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe, std::string("/dev/zero")}) {
    const auto database = OpenDatabaseReadOnly(path);
    ASSERT_FALSE(database.ok());
    EXPECT_EQ(database.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(database.error().message, HasSubstr(path == pipe ? "is a pipe" : "is a device"));
  }
}

TEST(OpenPrivate, AsksForNoLockAndReadsWhatIsInWalMode) {
  const std::string path = testing::TempDir() + "/private.db";
  std::filesystem::remove(path);
  OpenPrivate(path).exec("CREATE TABLE t (x)");
  SQLite::Database other(path, SQLite::OPEN_READWRITE);
  other.exec("BEGIN EXCLUSIVE");
  OpenPrivate(path).exec("INSERT INTO t VALUES (1)");  // a file system without locks says that it is locked
  other.exec("ROLLBACK");
  other.exec("PRAGMA journal_mode = WAL");
  {
    SQLite::Database copied = OpenPrivate(path);
    EXPECT_EQ(copied.execAndGet("SELECT count(*) FROM t").getInt(), 1);
    copied.exec("PRAGMA journal_mode = DELETE");
  }
}

TEST(DatabaseUri, TwoSlashesAreNoHost) {
  const std::string path = "/" + testing::TempDir() + "/two_slashes.db";
  std::filesystem::remove(path);
  OpenPrivate(path).exec("CREATE TABLE t (x)");
  EXPECT_TRUE(OpenDatabaseReadOnly(path).ok());
}

}  // namespace
}  // namespace cairn
