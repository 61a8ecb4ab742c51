// Databases that show more than they hold.
#include <unistd.h>

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/colmap_database.h"
#include "core/files/database.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class HostileDatabase : public testing::Test {
 protected:
  HostileDatabase() : folder_(fmt::format("{}/hostile_database_test_{}", testing::TempDir(), getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~HostileDatabase() override { fs::remove_all(folder_); }

  std::string Write(const std::string& sql) {
    const std::string path = (folder_ / "hostile.db").string();
    fs::remove(path);
    SQLite::Database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec("BEGIN;" + sql + "; COMMIT");
    return path;
  }

  // What opening the file and reading all rows of `query` says; "" where nothing is wrong.
  std::string Reading(const std::string& sql, const std::string& query = "SELECT 1") {
    const std::string path = Write(sql);
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
      LimitedStatement rows(database, query);
      if (rows.getBindParameterCount() > 0) rows.bind(1, 1);
      while (rows.executeStep()) {
      }
      return Ok();
    });
    if (status.ok()) return "";
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(status.error().message, HasSubstr(path));
    return status.error().message;
  }

  fs::path folder_;
};

std::string Tables(int num_tables) {
  std::string sql;
  for (int i = 0; i < num_tables; ++i) sql += fmt::format("CREATE TABLE t{} (x);", i);
  return sql;
}

// SQLite parses every text of a schema when it opens a file, and keeps what it finds.
TEST_F(HostileDatabase, SchemasAreShort) {
  const auto comment = [](int num_bytes) {
    const std::string begin = "CREATE TABLE t (x /*", end = "*/)";
    return begin + std::string(static_cast<size_t>(num_bytes) - begin.size() - end.size(), '-') + end;
  };
  EXPECT_EQ(Reading(comment(8192)), "");
  EXPECT_NE(Reading(comment(8193)), "");
  EXPECT_EQ(Reading(Tables(200)), "");
  EXPECT_THAT(Reading(Tables(400)), HasSubstr("shows more rows than a file of its size can hold"));
  const auto columns = [](int num_columns) {
    std::string sql = "CREATE TABLE t (x0";
    for (int i = 1; i < num_columns; ++i) sql += fmt::format(", x{}", i);
    return sql + ")";
  };
  EXPECT_EQ(Reading(columns(64)), "");
  EXPECT_THAT(Reading(columns(65)), HasSubstr("too many columns"));
}

TEST_F(HostileDatabase, ColumnsStoreTheirValues) {
  EXPECT_EQ(Reading("CREATE TABLE t (a, b DEFAULT 'none')"), "");
  for (const char* kind : {"VIRTUAL", "STORED"}) {
    EXPECT_THAT(Reading(fmt::format("CREATE TABLE t (a, c AS (hex(zeroblob(100000000))) {})", kind)),
                HasSubstr("column c of table t is generated"));
  }
  const auto with_default = [](int num_bytes) {  // its quotes count
    return fmt::format("CREATE TABLE t (a, b DEFAULT '{}')",
                       std::string(static_cast<size_t>(num_bytes) - 2, 'x'));
  };
  EXPECT_EQ(Reading(with_default(100)), "");
  EXPECT_THAT(Reading(with_default(101)), HasSubstr("column b of table t has a long default"));
  // In a database of COLMAP, too, and wherever a file is opened.
  const std::string path = Write(std::string(kColmapSchema) + "CREATE TABLE t (a, b AS (1))");
  EXPECT_THAT(OpenColmapDatabase(path).error().message, HasSubstr("column b of table t is generated"));
  EXPECT_THROW(OpenImmutable(path), SQLite::Exception);
}

TEST_F(HostileDatabase, PlainTablesStoreTheirRows) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(
      "CREATE TABLE plain (a, b); CREATE VIEW view AS SELECT a FROM plain; CREATE VIRTUAL TABLE virtual "
      "USING "
      "fts5 (a); CREATE TABLE generated (a, b AS (a) VIRTUAL); CREATE INDEX indexed ON plain (a)");
  EXPECT_TRUE(CheckPlainTable(database, "a.db", "plain").ok());
  for (const char* table : {"view", "virtual", "generated", "indexed", "absent"}) {
    const Status status = CheckPlainTable(database, "a.db", table);
    ASSERT_FALSE(status.ok()) << table;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    EXPECT_EQ(status.error().message, fmt::format("a.db: has no plain table '{}'", table));
  }
}

// A row of five bytes shows the column that was added to it, and pages that belong to many rows show as much.
TEST_F(HostileDatabase, RowsShowNoMoreThanTheFileHas) {
  const auto rows_of = [](int num_rows, int num_bytes) {
    return fmt::format(
        "CREATE TABLE t (a); WITH RECURSIVE c (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < {}) "
        "INSERT INTO t SELECT NULL FROM c; ALTER TABLE t ADD COLUMN b DEFAULT '{}'",
        num_rows, std::string(static_cast<size_t>(num_bytes), 'x'));
  };
  const std::string query = "SELECT b FROM t";
  EXPECT_EQ(Reading(rows_of(20'000, 50)), "");
  const std::string path = Write(rows_of(20'000, 50));
  const auto most = static_cast<int64_t>(1'000'000 + 2 * fs::file_size(path));
  EXPECT_EQ(Reading(rows_of(20'000, static_cast<int>(most / 20'000) - 5), query), "");
  EXPECT_THAT(Reading(rows_of(20'000, static_cast<int>(most / 20'000) - 3), query),
              HasSubstr("shows more rows than a file of its size can hold"));
  // Blobs as well as texts; numbers are as long as they are stored.
  const std::string blobs = "SELECT CAST(b AS BLOB) FROM t";
  EXPECT_EQ(Reading(rows_of(20'000, static_cast<int>(most / 20'000) - 5), blobs), "");
  EXPECT_NE(Reading(rows_of(20'000, static_cast<int>(most / 20'000) - 3), blobs), "");
  EXPECT_EQ(Reading(rows_of(20'000, 50), "SELECT 12345678901 + length(b), a, 1.5, 2 FROM t"), "");
  // All runs of a statement together.
  const std::string small = Write(rows_of(20'000, 30));
  SQLite::Database database = OpenDatabaseReadOnly(small).value();
  LimitedStatement rows(database, query);
  int num_rows = 0;
  EXPECT_THROW(
      {
        for (int run = 0; run < 5; ++run) {
          while (rows.executeStep()) ++num_rows;
          rows.reset();
        }
      },
      SQLite::Exception);
  EXPECT_EQ(num_rows, static_cast<int>((1'000'000 + 2 * fs::file_size(small)) / 34));
}

TEST_F(HostileDatabase, TablesAreReadByTheirKeys) {
  const std::string with = "CREATE TABLE t (k INTEGER PRIMARY KEY, x); INSERT INTO t VALUES (1, 2)";
  const std::string without = "CREATE TABLE t (k INTEGER, x); INSERT INTO t VALUES (1, 2)";
  for (const char* query : {"SELECT x FROM t ORDER BY k", "SELECT x FROM t WHERE k = ?",
                            "SELECT x FROM t a LEFT JOIN t b USING (k)"}) {
    SCOPED_TRACE(query);
    std::string sql = query;
    if (sql.find("USING") != std::string::npos) sql.replace(sql.find("SELECT x"), 8, "SELECT b.x");
    EXPECT_EQ(Reading(with, sql), "");
    EXPECT_THAT(Reading(without, sql), HasSubstr("a table lacks the key by which it is read"));
    EXPECT_NE(Reading("CREATE TABLE t (k INTEGER PRIMARY KEY DESC, x)", sql), Reading(without, sql));
  }
  EXPECT_EQ(Reading(without, "SELECT x FROM t"), "");
  EXPECT_EQ(Reading("CREATE TABLE t (k TEXT PRIMARY KEY, x) WITHOUT ROWID", "SELECT x FROM t ORDER BY k"),
            "");
  EXPECT_EQ(Reading("CREATE TABLE t (k TEXT UNIQUE, x)", "SELECT x FROM t WHERE k = ?"), "");
}

// Features are read an image at a time, by as many statements.
TEST_F(HostileDatabase, FeaturesAreNoMoreThanTheFile) {
  for (const char* table : {"keypoints", "descriptors"}) {
    const auto with_default = [&](int num_bytes) {
      return fmt::format(
          "{}; DROP TABLE {}; CREATE TABLE {} (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
          "cols INTEGER NOT NULL); WITH RECURSIVE c (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c WHERE i < "
          "20000) INSERT INTO {} SELECT i, 1, 2 FROM c; ALTER TABLE {} ADD COLUMN data BLOB DEFAULT x'{}'",
          kColmapSchema, table, table, table, table, std::string(static_cast<size_t>(2 * num_bytes), '0'));
    };
    EXPECT_TRUE(OpenColmapDatabase(Write(with_default(8))).ok()) << table;
    const Result<SQLite::Database> more = OpenColmapDatabase(Write(with_default(40)));
    ASSERT_FALSE(more.ok());
    EXPECT_EQ(more.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(more.error().message, HasSubstr(fmt::format("table {} shows 800000 bytes", table)));
  }
}

TEST_F(HostileDatabase, ImagesWithoutAKeyAreNotRead) {
  std::string schema = kColmapSchema;
  const std::string key = "image_id INTEGER PRIMARY KEY NOT NULL, rows";
  const std::string path = Write([&] {
    std::string sql = schema;
    for (size_t at = sql.find(key); at != std::string::npos; at = sql.find(key))
      sql.replace(at, key.size(), "image_id INTEGER NOT NULL, rows");
    return sql +
           "INSERT INTO cameras VALUES (1, 0, 9, 9, x'', 0); INSERT INTO images (image_id, name, "
           "camera_id) VALUES (1, 'a', 1); INSERT INTO keypoints VALUES (1, 0, 2, x''), (1, 0, 2, x'')";
  }());
  SQLite::Database database = OpenColmapDatabase(path).value();
  EXPECT_TRUE(ReadDatabaseImages(database).ok());
  EXPECT_THROW((void)ReadDatabaseKeypoints(database, 1), SQLite::Exception);
  EXPECT_THROW((void)ReadDatabaseDescriptors(database, 1, {}), SQLite::Exception);
  EXPECT_THROW((void)ReadDatabaseTwoViewGeometries(database, 0), SQLite::Exception);
}

}  // namespace
}  // namespace cairn
