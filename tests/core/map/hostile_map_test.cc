// Maps that somebody without the key has changed, given to a reader that requires the key: it refuses them,
// or reads what was signed.  (MapSeal tests damage; here the file is changed by an expert in SQLite.)
#include <functional>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "tests/core/map/full_rows.h"
#include "tests/core/map/sealed_blocks.h"

namespace cairn {
namespace {

using testing::HasSubstr;

constexpr const char* kRefused = "refused";

std::string InFolder(const std::string& name) { return testing::TempDir() + "/" + name; }

// Not WriteFileAtomically: thousands of syncs take minutes.
void WriteBytes(const std::string& path, const std::string& bytes) {
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  ASSERT_EQ(std::fwrite(bytes.data(), 1, bytes.size(), file), bytes.size());
  std::fclose(file);
}

std::string PoseText(const Pose& pose) {
  const auto& q = pose.rotation;
  const auto& t = pose.translation;
  return fmt::format("pose {} {} {} {} {} {} {}\n", q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z());
}

std::string HeadText(const MapHead& head) {
  std::string text =
      fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {}\n", head.name,
                  head.writer, head.instruction_set, head.seed, head.sealed, head.epoch, head.findings_hash,
                  head.landmark_choice, head.documents, head.algorithm, head.k, head.tau, head.rho,
                  head.lower_bound.value_or(-1), head.uncovered_limit, head.frame.unit, head.frame.source,
                  head.frame.is_reconstructed, head.frame.anchor.has_value(), head.stated_pose_sigma_m,
                  head.stated_pose_sigma_deg, fmt::join(head.sessions, ","));
  for (const auto& [stage, options] : head.stage_options) text += stage + ": " + options;
  for (const auto& [name, hash] : head.input_hashes) text += name + ": " + hash + "\n";
  for (const auto& [name, value] : head.self_test) text += fmt::format("{}: {}\n", name, value);
  for (const Camera& camera : head.cameras) {
    text += fmt::format("{} {} {} {} {} {}\n", camera.camera_id, static_cast<int>(camera.model), camera.width,
                        camera.height, camera.has_focal_prior, fmt::join(camera.params, ","));
  }
  return text + PoseText(head.floor_from_world) + PoseText(head.camera_from_given);
}

std::string FindingsText(const MapFindings& findings) {
  std::string text;
  for (const RegionSelfTest& row : findings.self_test_regions) {
    const RegionSelfTest::Errors errors = row.errors.value_or(RegionSelfTest::Errors());
    text += fmt::format("{} {} {} {} {} {} {} {} {}\n", row.region, row.num_held_out, row.num_localized,
                        row.num_gross_errors, row.errors.has_value(), errors.median_m, errors.median_deg,
                        errors.p90_m, errors.p90_deg);
  }
  for (const RegionEntropy& row : findings.region_entropies)
    text += fmt::format("{} {}\n", row.region, row.entropy);
  for (const DropCount& row : findings.drops) {
    text += fmt::format("{} {} {} {} {} {} {}\n", row.reason_id, row.stage, row.kind, row.name, row.text,
                        row.num_dropped, fmt::join(row.at_stations, ","));
  }
  for (const MapChange& row : findings.changes) {
    text += fmt::format("{} {} {} {} {} {} {} {} {} {} {}\n", row.session, row.position.x(), row.position.y(),
                        row.position.z(), row.radius_m, row.num_vanished, row.num_appeared, row.image_before,
                        row.image_after, row.moved_to, row.num_moved);
  }
  if (findings.promise) {
    const MapPromise& promise = *findings.promise;
    text += fmt::format("{} {} {} {} {} {}\n", promise.terms.min_matches, promise.terms.max_error_m,
                        promise.terms.probability, promise.model.shape, promise.radius_m,
                        promise.landmarks_lower_bound);
    for (const NodePromise& node : promise.nodes) {
      text += fmt::format("{} {} {} {} {} {}\n", node.image, node.other_image, node.region, node.probability,
                          node.num_matches, node.sigma_m);
    }
    for (const auto* curve : {&promise.left_out, &promise.held_out}) {
      for (const PromiseBin& bin : *curve)
        text += fmt::format("{} {} {}\n", bin.least, bin.num, bin.num_kept);
    }
  }
  return text;
}

class HostileMap : public testing::Test {
 protected:
  HostileMap() : path_(InFolder("hostile.cairn")) {
    EXPECT_TRUE(WriteMapRows(FullRows(), InFolder("plain.cairn")).ok());
    EXPECT_TRUE(SignMap(InFolder("plain.cairn"), keys_.secret_key, InFolder("signed.cairn")).ok());
    signed_bytes_ = *ReadFile(InFolder("signed.cairn"));
    WriteBytes(path_, signed_bytes_);
    signed_contents_ = Contents();
    EXPECT_NE(signed_contents_, kRefused);
  }

  // All that a reader with the key gets out of the map.
  std::string Contents() const {
    const Result<MapFile> file = MapFile::Open(path_, {.public_key = keys_.public_key});
    if (!file.ok()) return kRefused;
    const Result<MapRows> rows = ReadMapRows(*file);
    if (!rows.ok()) return kRefused;
    std::string contents = HeadText(*rows) + FindingsText(rows->findings);
    for (const BlockContents& block : BlocksOf(*file)) {
      contents += fmt::format("\n{} {} ", static_cast<int>(block.kind), block.count) + block.bytes;
    }
    return contents;
  }

  // The signed map, changed by SQL.
  void Change(const std::vector<std::string>& statements) {
    WriteBytes(path_, signed_bytes_);
    SQLite::Database database(path_, SQLite::OPEN_READWRITE);
    database.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA writable_schema = ON");
    for (const std::string& statement : statements) database.exec(statement);
  }

  void ExpectRefusedOrAsSigned(const std::string& change) {
    const std::string contents = Contents();
    ++(contents == kRefused ? num_refused_ : num_as_signed_);
    EXPECT_TRUE(contents == kRefused || contents == signed_contents_) << change;
  }

  std::vector<std::string> Tables() const {
    SQLite::Database database(InFolder("signed.cairn"));
    SQLite::Statement query(database, "SELECT name FROM sqlite_schema WHERE type = 'table'");
    std::vector<std::string> tables;
    while (query.executeStep()) tables.push_back(query.getColumn(0).getString());
    EXPECT_EQ(tables.size(), 14u);
    return tables;
  }

  std::vector<std::string> Columns(const std::string& table) const {
    SQLite::Database database(InFolder("signed.cairn"));
    SQLite::Statement query(database, "SELECT name FROM pragma_table_info(?)");
    query.bind(1, table);
    std::vector<std::string> columns;
    while (query.executeStep()) columns.push_back(query.getColumn(0).getString());
    return columns;
  }

  std::string Schema(const std::string& table) const {
    SQLite::Database database(InFolder("signed.cairn"));
    SQLite::Statement query(database, "SELECT sql FROM sqlite_schema WHERE name = ?");
    query.bind(1, table);
    EXPECT_TRUE(query.executeStep());
    return query.getColumn(0).getString();
  }

  void ChangeSchema(const std::string& table, const std::string& sql) {
    WriteBytes(path_, signed_bytes_);
    SQLite::Database database(path_, SQLite::OPEN_READWRITE);
    database.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA writable_schema = ON");
    SQLite::Statement update(database, "UPDATE sqlite_schema SET sql = ? WHERE name = ?");
    update.bind(1, sql);
    update.bind(2, table);
    update.exec();
  }

  // Another value of the same type.
  static std::string Lie(const std::string& column) {
    return fmt::format(
        "CASE typeof({0}) WHEN 'integer' THEN {0} + 1 WHEN 'real' THEN {0} + 25.0 WHEN 'text' THEN {0} || "
        "'7' "
        "ELSE CAST(x'01' || {0} AS BLOB) END",
        column);
  }

  const KeyPair keys_ = MakeKeyPair();
  const std::string path_;
  std::string signed_bytes_;
  std::string signed_contents_;
  int num_refused_ = 0;
  int num_as_signed_ = 0;
};

TEST_F(HostileMap, ExchangedColumnNamesAreReadAsSigned) {
  for (const std::string& table : Tables()) {
    const std::vector<std::string> columns = Columns(table);
    for (size_t i = 0; i < columns.size(); ++i) {
      for (size_t k = i + 1; k < columns.size(); ++k) {
        const auto replaced = [](const std::string& text, const std::string& name, const std::string& by) {
          return std::regex_replace(text, std::regex("\\b" + name + "\\b"), by);
        };
        std::string sql = replaced(Schema(table), columns[i], "between_names");
        sql = replaced(replaced(sql, columns[k], columns[i]), "between_names", columns[k]);
        ChangeSchema(table, sql);
        ExpectRefusedOrAsSigned(fmt::format("{}: {} and {} exchanged", table, columns[i], columns[k]));
      }
    }
  }
  EXPECT_GE(num_as_signed_, 20);  // columns are known by their places
}

TEST_F(HostileMap, OtherTypesOfColumnsAreRefused) {
  for (const std::string& table : Tables()) {
    for (const std::string type : {"TEXT", "REAL", "INTEGER", "BLOB"}) {
      for (const std::string other : {"TEXT", "REAL", "INTEGER", "BLOB", "TEXT COLLATE NOCASE", ""}) {
        ChangeSchema(table, std::regex_replace(Schema(table), std::regex(type), other));
        ExpectRefusedOrAsSigned(fmt::format("{}: {} is {}", table, type, other));
      }
    }
  }
  EXPECT_GT(num_refused_, 0);
}

// An index over all columns answers for the table: one whose pages state other values.
TEST_F(HostileMap, LyingIndicesAreNotAsked) {
  for (const std::string& table : Tables()) {
    const std::vector<std::string> columns = Columns(table);
    for (const std::string& column : columns) {
      const std::string index = fmt::format("CREATE INDEX lie ON {} ({})", table, fmt::join(columns, ", "));
      Change({fmt::format("CREATE TEMP TABLE truth AS SELECT * FROM {}", table),
              fmt::format("UPDATE OR IGNORE {} SET {} = {}", table, column, Lie(column)), index,
              "CREATE TEMP TABLE kept AS SELECT * FROM sqlite_schema WHERE name = 'lie'",
              "DELETE FROM sqlite_schema WHERE name = 'lie'", "PRAGMA writable_schema = RESET",
              fmt::format("DELETE FROM {}", table), fmt::format("INSERT INTO {} SELECT * FROM truth", table),
              "PRAGMA writable_schema = ON", "INSERT INTO sqlite_schema SELECT * FROM kept"});
      ExpectRefusedOrAsSigned(fmt::format("{}: index with another {}", table, column));
    }
  }
  EXPECT_GE(num_as_signed_, 20);
}

TEST_F(HostileMap, OtherValuesRowsAndTablesAreRefused) {
  for (const std::string& table : Tables()) {
    if (table == "seal") continue;  // MapSeal
    for (const std::string& column : Columns(table)) {
      Change({fmt::format("UPDATE OR IGNORE {} SET {} = {}", table, column, Lie(column))});
      EXPECT_EQ(Contents(), kRefused) << table << '.' << column;
    }
    Change({fmt::format("DELETE FROM {}", table)});
    EXPECT_EQ(Contents(), kRefused) << table << " emptied";
    Change({fmt::format("ALTER TABLE {} RENAME TO old", table)});
    EXPECT_EQ(Contents(), kRefused) << table << " missing";
    Change({fmt::format("ALTER TABLE {} RENAME TO old", table),
            fmt::format("CREATE VIEW {0} AS SELECT * FROM old", table)});
    EXPECT_EQ(Contents(), kRefused) << table << " is a view";
    Change({fmt::format("ALTER TABLE {} ADD COLUMN later AS (zeroblob(100000000))", table)});
    EXPECT_EQ(Contents(), kRefused) << table << " has a generated column";
    Change({fmt::format("ALTER TABLE {} ADD COLUMN later DEFAULT 7", table)});
    ExpectRefusedOrAsSigned(table + " has a column more");
    Change({fmt::format("CREATE TRIGGER t BEFORE INSERT ON {} BEGIN SELECT 1; END", table)});
    ExpectRefusedOrAsSigned(table + " has a trigger");
  }
}

TEST_F(HostileMap, RowsOfOneTableAreNotReadAsThoseOfAnother) {
  const std::vector<std::string> tables = Tables();
  for (size_t i = 0; i < tables.size(); ++i) {
    for (size_t k = i + 1; k < tables.size(); ++k) {
      Change(
          {"CREATE TEMP TABLE roots AS SELECT name, rootpage FROM sqlite_schema",
           fmt::format("UPDATE sqlite_schema SET rootpage = (SELECT rootpage FROM roots WHERE name = '{1}') "
                       "WHERE name = '{0}'",
                       tables[i], tables[k]),
           fmt::format("UPDATE sqlite_schema SET rootpage = (SELECT rootpage FROM roots WHERE name = '{0}') "
                       "WHERE name = '{1}'",
                       tables[i], tables[k])});
      ExpectRefusedOrAsSigned(fmt::format("{} and {} exchanged", tables[i], tables[k]));
    }
  }
  EXPECT_GT(num_refused_, 50);
}

TEST_F(HostileMap, EveryChangedByteIsRefusedOrChangesNothing) {
  Random random(7);
  std::vector<size_t> places;
  for (size_t i = 0; i < 100; ++i) places.push_back(i);  // SQLite's header
  for (int i = 0; i < 3000; ++i) places.push_back(random.UniformInt(100, signed_bytes_.size() - 1));
  for (const size_t place : places) {
    std::string bytes = signed_bytes_;
    bytes[place] = static_cast<char>(bytes[place] ^ random.UniformInt(1, 255));
    WriteBytes(path_, bytes);
    ExpectRefusedOrAsSigned(fmt::format("byte {}", place));
  }
  EXPECT_GT(num_refused_, 500);  // many lie in unused space
}

// --- Files whose pages show more rows than anybody can read

// Big-endian, as SQLite's pages.
void Put(std::string* bytes, size_t place, uint64_t value, int num_bytes) {
  for (int i = num_bytes - 1; i >= 0; --i, value >>= 8) (*bytes)[place + i] = static_cast<char>(value & 0xff);
}

// An interior page all of whose cells lead to one child.  `record`: what a cell of an index's page
// has beside.
std::string PageOfManyChildren(size_t page_size, size_t begin, uint32_t child, const std::string& record) {
  std::string page(page_size, '\0');
  const size_t header = begin;
  const std::string cell_end = record.empty() ? std::string(1, '\1') : record;
  const size_t cell_size = 4 + cell_end.size();
  const size_t num_cells = std::min<size_t>(120, (page_size - header - 12) / (cell_size + 2));
  size_t content = page_size;
  for (size_t i = 0; i < num_cells; ++i) {
    content -= cell_size;
    Put(&page, content, child, 4);
    std::string end = cell_end;
    if (record.empty()) end[0] = static_cast<char>(i + 1);  // the largest rowid below it
    page.replace(content + 4, end.size(), end);
    Put(&page, header + 12 + 2 * i, content, 2);
  }
  page[header] = record.empty() ? '\5' : '\2';
  Put(&page, header + 3, num_cells, 2);
  Put(&page, header + 5, content, 2);
  Put(&page, header + 8, child, 4);
  return page;
}

// The signed map with the root of a table replaced by twelve levels of such pages over what it was.
std::string Endless(const std::string& map, size_t root, bool is_index, size_t num_columns) {
  constexpr int kNumLevels = 12;
  const size_t page_size = ParseSqliteHeader(map).page_size;
  const size_t begin = root == 1 ? 100 : 0;
  std::string record;
  if (is_index) {  // payload's length, then a record of texts of one character
    record = std::string(1, static_cast<char>(1 + 2 * num_columns)) + static_cast<char>(1 + num_columns) +
             std::string(num_columns, '\x0f') + std::string(num_columns, 'x');
  }
  std::string bytes = map;
  std::string leaf = map.substr((root - 1) * page_size, page_size);
  if (begin > 0) {  // the header of page 1 stays: move the b-tree's to the page's start
    const size_t num_cells =
        static_cast<uint8_t>(leaf[begin + 3]) * 256 + static_cast<uint8_t>(leaf[begin + 4]);
    const size_t header_size = leaf[begin] == '\5' ? 12 : 8;
    leaf.replace(0, header_size + 2 * num_cells, leaf.substr(begin, header_size + 2 * num_cells));
  }
  const auto first_new = static_cast<uint32_t>(map.size() / page_size + 1);
  const std::string top = PageOfManyChildren(page_size, begin, first_new, record);
  bytes.replace((root - 1) * page_size + begin, page_size - begin, top.substr(begin));
  for (int level = 1; level < kNumLevels; ++level)
    bytes += PageOfManyChildren(page_size, 0, first_new + level, record);
  bytes += leaf;
  Put(&bytes, 28, bytes.size() / page_size, 4);
  return bytes;
}

TEST_F(HostileMap, TablesWithoutEndAreRefused) {
  const size_t page_size = ParseSqliteHeader(signed_bytes_).page_size;
  std::map<std::string, size_t> roots = {{"sqlite_schema", 1}};
  {
    SQLite::Database database(InFolder("signed.cairn"));
    SQLite::Statement query(database, "SELECT name, rootpage FROM sqlite_schema");
    while (query.executeStep()) roots[query.getColumn(0).getString()] = query.getColumn(1).getInt();
  }
  EXPECT_EQ(roots.size(), 15u);
  for (const auto& [table, root] : roots) {
    if (table == "seal") continue;  // read without SQLite
    const char type = signed_bytes_[(root - 1) * page_size + (root == 1 ? 100 : 0)];
    const bool is_index = type == '\2' || type == '\x0a';
    const size_t num_columns = table == "sqlite_schema" ? 5 : Columns(table).size();
    WriteBytes(path_, Endless(signed_bytes_, root, is_index, num_columns));
    const Result<MapFile> file = MapFile::Open(path_, {});
    if (file.ok()) {
      const Result<MapRows> rows = ReadMapRows(*file);
      if (table == "directory" || table == "blocks") {  // one row is asked for, by its number
        EXPECT_TRUE(!rows.ok() || rows->name == "example") << table;
      } else {
        EXPECT_FALSE(rows.ok()) << table;
      }
    } else {
      EXPECT_THAT(file.error().message, HasSubstr("hostile.cairn")) << table;
    }
  }
}

TEST_F(HostileMap, TablesWithoutEndOfAnOldMapAreRefused) {
  const std::string golden = GOLDEN_DIR "/map_1.0.cairn";
  const std::string bytes = ReadFile(golden).value();
  SQLite::Database database(golden, SQLite::OPEN_READONLY);
  for (const char* table : {"landmarks", "stations"}) {
    const int root =
        database.execAndGet(fmt::format("SELECT rootpage FROM sqlite_schema WHERE name = '{}'", table))
            .getInt();
    WriteBytes(path_, Endless(bytes, static_cast<size_t>(root), false, 0));
    const Result<MapRows> migrated = ReadMapRowsVersion1(path_);
    ASSERT_FALSE(migrated.ok()) << table;
    EXPECT_EQ(migrated.error().code, ErrorCode::kCorrupt) << table;
  }
}

// A view of a few bytes has as many rows as its author likes.
TEST_F(HostileMap, ViewsInThePlaceOfAnOldMapsTablesAreRefused) {
  const std::string bytes = ReadFile(GOLDEN_DIR "/map_1.0.cairn").value();
  for (const char* table : {"landmarks", "stations", "regions", "images", "vocabulary", "vocabulary_nodes",
                            "vocabulary_words", "vocabulary_documents"}) {
    WriteBytes(path_, bytes);
    SQLite::Database(path_, SQLite::OPEN_READWRITE)
        .exec(fmt::format("ALTER TABLE {0} RENAME TO kept; CREATE VIEW {0} AS SELECT * FROM kept", table));
    const Result<MapRows> migrated = ReadMapRowsVersion1(path_);
    ASSERT_FALSE(migrated.ok()) << table;
    EXPECT_EQ(migrated.error().code, ErrorCode::kCorrupt) << table;
    EXPECT_THAT(migrated.error().message, HasSubstr(fmt::format("has no plain table '{}'", table)));
  }
}

}  // namespace
}  // namespace cairn
