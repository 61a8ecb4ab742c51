// Rows of a map's small tables: what is read of them, what is refused, and how numbers are stored.
#include "core/map/map_tables.h"

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/files/file.h"
#include "core/map/left_out_folder.h"
#include "core/map/map_epoch.h"
#include "core/map/map_file.h"
#include "core/map/map_findings_tables.h"
#include "core/map/map_head_tables.h"
#include "core/seal/map_seal.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using Values = std::vector<StoredValue>;

StoredText T(const std::string& text) { return {text}; }
StoredBlob Varints(const std::vector<uint64_t>& numbers) {
  BlobWriter writer;
  for (const uint64_t number : numbers) writer.Varint(number);
  return {writer.Take()};
}
StoredValue I(int64_t value) { return value; }

StoredRows RowsOf(const std::string& table, const std::vector<Values>& rows) {
  StoredRows stored;
  for (const Values& values : rows)
    stored[table].emplace_back(std::make_shared<const std::string>("map.cairn: table " + table), 1, values);
  return stored;
}

// The message of a refusal; "" where there is none.
template <typename T>
std::string MessageOf(const Result<T>& result) {
  return result.ok() ? "" : result.error().message;
}
std::string MessageOf(const Status& status) { return status.ok() ? "" : status.error().message; }

std::string Decoding(const std::string& table, Values values, size_t column, const StoredValue& value) {
  values[column] = value;
  return MessageOf(DecodeMapFindings(RowsOf(table, {values}), "map.cairn"));
}

constexpr int64_t kMost = 2147483647;

TEST(StoredRow, ValuesOfAnotherTypeAreNamed) {
  const StoredRow row(std::make_shared<const std::string>("map.cairn: table meta"), 2,
                      {I(5), 2.5, T("a"), StoredBlob{"b"}, std::monostate()});
  EXPECT_EQ(*row.Integer(0), 5);
  EXPECT_EQ(*row.Real(1), 2.5);
  EXPECT_EQ(*row.Text(2), "a");
  EXPECT_EQ(*row.Blob(3), "b");
  EXPECT_TRUE(row.IsNull(4));
  EXPECT_FALSE(row.IsNull(0));
  EXPECT_THAT(MessageOf(row.Integer(1)),
              HasSubstr("map.cairn: table meta, row 2: column 2 is a number, expected an integer"));
  EXPECT_THAT(MessageOf(row.Real(0)), HasSubstr("column 1 is an integer, expected a number"));
  EXPECT_THAT(MessageOf(row.Text(3)), HasSubstr("column 4 is a blob, expected a text"));
  EXPECT_THAT(MessageOf(row.Blob(2)), HasSubstr("column 3 is a text, expected a blob"));
  EXPECT_THAT(MessageOf(row.Real(4)), HasSubstr("column 5 is nothing, expected a number"));
  EXPECT_EQ(*row.Integer(0, 5, 5), 5);
  EXPECT_THAT(MessageOf(row.Integer(0, 6, 9)), HasSubstr("column 1 is 5, expected 6 to 9"));
  EXPECT_THAT(MessageOf(row.Integer(0, 1, 4)), HasSubstr("column 1 is 5, expected 1 to 4"));
}

TEST(StoredRow, TablesAreReadUpToTheirLimits) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(
      "CREATE TABLE t (a INTEGER PRIMARY KEY, b TEXT, c BLOB); INSERT INTO t VALUES (2, 'four', x'010203'), "
      "(1, NULL, 1.5)");
  const auto read = [&](size_t num_columns, size_t num_rows, int64_t num_bytes) {
    return ReadStoredRows(database, "map.cairn", {{"t", num_columns, num_rows}}, num_bytes);
  };
  const Result<StoredRows> rows = read(3, 2, 7);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  const std::vector<StoredRow>& of_table = rows->at("t");
  ASSERT_EQ(of_table.size(), 2u);
  EXPECT_EQ(*of_table[0].Integer(0), 1);
  EXPECT_TRUE(of_table[0].IsNull(1));
  EXPECT_EQ(*of_table[0].Real(2), 1.5);
  EXPECT_EQ(*of_table[1].Text(1), "four");
  EXPECT_EQ(*of_table[1].Blob(2), "\1\2\3");
  EXPECT_THAT(MessageOf(of_table[1].Integer(2)), HasSubstr("map.cairn: table t, row 2: column 3"));
  EXPECT_EQ(MessageOf(read(2, 2, 7)), "");
  EXPECT_THAT(MessageOf(read(4, 2, 7)), HasSubstr("table t has 3 columns, expected 4"));
  EXPECT_THAT(MessageOf(read(3, 1, 7)), HasSubstr("table t has more than 1 rows"));
  EXPECT_THAT(MessageOf(read(3, 2, 6)), HasSubstr("table t shows more than the 6 bytes that the file has"));
}

// NULLs take a byte each.
TEST(StoredRow, ValuesAreNoMoreThanAFileHolds) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(
      "CREATE TABLE t (a INTEGER PRIMARY KEY, b, c); WITH RECURSIVE r (i) AS (SELECT 1 UNION ALL SELECT i + "
      "1 "
      "FROM r WHERE i < 30000) INSERT INTO t SELECT i, NULL, NULL FROM r");
  const auto read = [&](int64_t num_bytes) {
    return MessageOf(ReadStoredRows(database, "map.cairn", {{"t", 3, 30'000}}, num_bytes));
  };
  // Three values and as much for each row: 180,000, of which 100,000 are any file's.
  EXPECT_EQ(read(240'000), "");
  EXPECT_THAT(read(239'996), HasSubstr("table t shows more than the 239996 bytes that the file has"));
}

// As schemas/FORMAT.md says: the name; per row its number of columns, per column its type and what it has; a
// 0 at the end.
TEST(StoredRow, HashIsOfWhatThePageSays) {
  StoredRows rows = RowsOf("b", {{I(7), 2.5, T("ab"), StoredBlob{"c"}, std::monostate()}, {}});
  rows["a"] = {};
  Hasher hasher;
  const auto number = [&](uint64_t value) { hasher.Add(value); };
  hasher.Add("a");
  number(0);
  hasher.Add("b");
  number(5);
  number(1), number(7);
  number(2), number(0x4004000000000000);
  number(3), number(2), hasher.Add("ab");
  number(4), number(1), hasher.Add("c");
  number(5);
  number(0);
  number(0);
  EXPECT_EQ(TablesHash(rows), hasher.Finish());
  Hasher root;
  root.Add("a");
  root.Add(uint64_t{0});
  root.Add(uint64_t{3});
  root.Add("dir");
  StoredRows head;
  head["a"] = {};
  EXPECT_EQ(RootHash(head, "dir"), root.Finish());
}

TEST(HeadTables, HaveTheColumnsOfTheSchemaAndAreBounded) {
  const auto& tables = HeadTables();
  const std::tuple<std::string, size_t, size_t> expected[] = {
      {"cameras", 6, 1048576}, {"frames", 8, 64},       {"inputs", 2, 4096},
      {"meta", 2, 4096},       {"self_test", 2, 65536}, {"stage_options", 2, 1024}};
  ASSERT_EQ(tables.size(), std::size(expected));
  for (size_t i = 0; i < tables.size(); ++i)
    EXPECT_EQ(std::tuple(std::string(tables[i].name), tables[i].min_num_columns, tables[i].max_num_rows),
              expected[i]);
  EXPECT_EQ(MaxStepsFor(0), 1'000'000);
  EXPECT_EQ(MaxStepsFor(500), 1'000'500);
  EXPECT_EQ(MaxRowBytes(0), 64 * 1024 * 1024);
  EXPECT_EQ(MaxRowBytes(10), 64 * 1024 * 1024 + 640);
}

TEST(FindingsRows, SelfTestsAreReadByTheirColumns) {
  const Values values = {I(3), I(9), I(8), I(2), 0.5, 1.5, 2.5, 3.5};
  const Result<MapFindings> read = DecodeMapFindings(RowsOf("self_test_regions", {values}), "map.cairn");
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->self_test_regions[0],
            (RegionSelfTest{3, 9, 8, 2, RegionSelfTest::Errors{0.5, 1.5, 2.5, 3.5}}));
  const auto decoding = [&](size_t column, const StoredValue& value) {
    return Decoding("self_test_regions", values, column, value);
  };
  EXPECT_EQ(decoding(0, I(-1)), "");
  EXPECT_EQ(decoding(0, I(kMost)), "");
  EXPECT_THAT(decoding(0, I(-2)), HasSubstr("column 1 is -2, expected -1 to 2147483647"));
  EXPECT_THAT(decoding(0, I(kMost + 1)), HasSubstr("column 1 is 2147483648"));
  for (size_t column = 1; column < 4; ++column) {
    EXPECT_EQ(decoding(column, I(0)), "");
    EXPECT_EQ(decoding(column, I(kMost)), "");
    EXPECT_THAT(decoding(column, I(-1)), HasSubstr("is -1, expected 0 to 2147483647"));
    EXPECT_THAT(decoding(column, I(kMost + 1)), HasSubstr("expected 0 to 2147483647"));
  }
  EXPECT_EQ(decoding(4, std::monostate()), "");  // none of the four counts then
  for (size_t column = 5; column < 8; ++column)
    EXPECT_THAT(decoding(column, std::monostate()), HasSubstr("is nothing"));
}

TEST(FindingsRows, EntropiesAndDropsAreReadByTheirColumns) {
  const Result<MapFindings> entropies =
      DecodeMapFindings(RowsOf("region_entropies", {{I(4), 0.25}}), "map.cairn");
  ASSERT_TRUE(entropies.ok());
  EXPECT_EQ(entropies->region_entropies[0], (RegionEntropy{4, 0.25}));
  EXPECT_EQ(Decoding("region_entropies", {I(0), 0.5}, 0, I(kMost)), "");
  EXPECT_THAT(Decoding("region_entropies", {I(0), 0.5}, 0, I(-1)), HasSubstr("expected 0 to 2147483647"));
  EXPECT_THAT(Decoding("region_entropies", {I(0), 0.5}, 0, I(kMost + 1)),
              HasSubstr("expected 0 to 2147483647"));
  const Values values = {
      I(44), T("stage"), T("kind"), T("name"), T("text"), I(7), Varints({0, 300, 2147483647, 2147483648})};
  const Result<MapFindings> drops = DecodeMapFindings(RowsOf("drop_reasons", {values}), "map.cairn");
  ASSERT_TRUE(drops.ok());
  EXPECT_EQ(drops->drops[0], (DropCount{44, "stage", "kind", "name", "text", 7, {0, 300, 2147483647, -1}}));
  EXPECT_THAT(Decoding("drop_reasons", values, 6, StoredBlob{"\x05\x80"}),
              HasSubstr("the counts of reason 44 are cut off"));
}

// Images 5 and 4: steps of 5 and -1.  A tenth of matches, thousandths of all else.
TEST(FindingsRows, PromisesAreReadByTheirColumns) {
  const StoredBlob nodes = Varints({10, 1, 3, 875, 999, 255, 500, /* the next */ 1, 0, 0, 0, 0, 0, 0});
  const Values values = {
      I(0),       I(12), 0.25, 3.0, 0.9, 0.75, 4.0, 1.5, 0.5, 15.0, I(17), nodes, Varints({250, 500, 4, 1}),
      Varints({})};
  const Result<MapFindings> read = DecodeMapFindings(RowsOf("promises", {values}), "map.cairn");
  ASSERT_TRUE(read.ok()) << read.error().message;
  const MapPromise& promise = *read->promise;
  EXPECT_EQ(promise.terms.min_matches, 12);
  EXPECT_EQ(promise.terms.max_error_m, 0.25);
  EXPECT_EQ(promise.terms.max_error_deg, 3);
  EXPECT_EQ(promise.terms.probability, 0.9);
  EXPECT_EQ(promise.model.match_ratio, 0.75);
  EXPECT_EQ(promise.model.shape, 4);
  EXPECT_EQ(promise.model.error_ratio, 1.5);
  EXPECT_EQ(promise.radius_m, 0.5);
  EXPECT_EQ(promise.radius_deg, 15);
  EXPECT_EQ(promise.landmarks_lower_bound, 17);
  EXPECT_THAT(promise.nodes,
              ElementsAre(NodePromise{5, 4, 3, 0.875, 25.5, 0.25, 0.999}, NodePromise{4, 4, 0, 0, 0, 0, 0}));
  EXPECT_EQ(promise.left_out, (std::vector<PromiseBin>{{0.25, 4, 1, 0.5}}));
  EXPECT_TRUE(promise.held_out.empty());
  const auto decoding = [&](size_t column, const StoredValue& value) {
    return Decoding("promises", values, column, value);
  };
  EXPECT_EQ(decoding(1, I(1)), "");
  EXPECT_EQ(decoding(1, I(kMost)), "");
  EXPECT_THAT(decoding(1, I(0)), HasSubstr("expected 1 to 2147483647"));
  EXPECT_THAT(decoding(1, I(kMost + 1)), HasSubstr("expected 1 to 2147483647"));
  EXPECT_EQ(decoding(11, Varints({2 * kMost, 0, 0, 0, 0, 0, 0})), "");
  EXPECT_THAT(decoding(11, Varints({2 * (kMost + 1), 0, 0, 0, 0, 0, 0})), HasSubstr("a node of no image"));
  EXPECT_THAT(decoding(11, Varints({1, 2, 0, 0, 0, 0, 0})), HasSubstr("a node of no image"));  // -1, 0
  EXPECT_THAT(decoding(11, Varints({0, 1, 0, 0, 0, 0, 0})), HasSubstr("a node of no image"));  // 0, -1
  EXPECT_EQ(decoding(11, Varints({0, 0, 0, 0, 0, 0, 0})), "");
  for (const size_t num : {1, 6, 8})
    EXPECT_THAT(decoding(11, Varints(std::vector<uint64_t>(num))), HasSubstr("the nodes are cut off"));
  for (const size_t num : {1, 3, 5}) {
    for (const size_t column : {12, 13})
      EXPECT_THAT(decoding(column, Varints(std::vector<uint64_t>(num))), HasSubstr("curve is cut off"));
  }
}

TEST(FindingsRows, ChangesAndMovesAreReadByTheirColumns) {
  const Values values = {I(0), I(1), I(-1250), I(2000), I(1), I(500), I(20), I(3), I(-1), I(2)};
  StoredRows rows = RowsOf("changes", {values, values});
  rows["moves"] = RowsOf("moves", {{I(1), I(0), I(12)}}).at("moves");
  const Result<MapFindings> read = DecodeMapFindings(rows, "map.cairn");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->changes[0], (MapChange{1, {-1.25, 2, 0.001}, 0.5, 20, 3, -1, 2}));
  EXPECT_EQ(read->changes[1], (MapChange{1, {-1.25, 2, 0.001}, 0.5, 20, 3, -1, 2, 0, 12}));
  const auto decoding = [&](size_t column, int64_t value) {
    return Decoding("changes", values, column, I(value));
  };
  for (const size_t column : {1, 6, 7}) {
    EXPECT_EQ(decoding(column, 0), "");
    EXPECT_EQ(decoding(column, kMost), "");
    EXPECT_THAT(decoding(column, -1), HasSubstr("expected 0 to 2147483647"));
    EXPECT_THAT(decoding(column, kMost + 1), HasSubstr("expected 0 to 2147483647"));
  }
  const int64_t exact = int64_t{1} << 53;
  for (size_t column = 2; column < 5; ++column) {
    EXPECT_EQ(decoding(column, exact), "");
    EXPECT_EQ(decoding(column, -exact), "");
    EXPECT_THAT(decoding(column, exact + 1), HasSubstr("expected -9007199254740992 to 9007199254740992"));
    EXPECT_THAT(decoding(column, -exact - 1), HasSubstr("expected -9007199254740992"));
  }
  EXPECT_EQ(decoding(5, 0), "");
  EXPECT_EQ(decoding(5, exact), "");
  EXPECT_THAT(decoding(5, -1), HasSubstr("expected 0 to 9007199254740992"));
  EXPECT_THAT(decoding(5, exact + 1), HasSubstr("expected 0 to 9007199254740992"));
  for (const size_t column : {8, 9}) {
    EXPECT_EQ(decoding(column, -1), "");
    EXPECT_EQ(decoding(column, kMost), "");
    EXPECT_THAT(decoding(column, -2), HasSubstr("expected -1 to 2147483647"));
    EXPECT_THAT(decoding(column, kMost + 1), HasSubstr("expected -1 to 2147483647"));
  }
  const auto move = [&](int64_t change, int64_t to, int64_t num) {
    rows["moves"] = RowsOf("moves", {{I(change), I(to), I(num)}}).at("moves");
    return MessageOf(DecodeMapFindings(rows, "map.cairn"));
  };
  EXPECT_EQ(move(0, 0, 0), "");
  EXPECT_THAT(move(2, 0, 1), HasSubstr("table moves: change 2 of 2"));
  EXPECT_THAT(move(-1, 0, 1), HasSubstr("table moves: change -1 of 2"));
  EXPECT_THAT(move(0, -1, 1), HasSubstr("expected 0 to 2147483647"));
  EXPECT_THAT(move(0, 0, -1), HasSubstr("expected 0 to 2147483647"));
}

// Nothing is promised that is not kept: probabilities are rounded down, all else to the nearest.
TEST(FindingsRows, PromisesAreStoredAsThePageSays) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec(
      "CREATE TABLE promises (a INTEGER PRIMARY KEY, b, c, d, e, f, g, h, i, j, k, nodes, left_out, "
      "held_out)");
  for (const char* table : {"self_test_regions (a, b, c, d, e, f, g, h)", "region_entropies (a, b)",
                            "drop_reasons (a, b, c, d, e, f, g)"})
    database.exec(std::string("CREATE TABLE ") + table);
  MapFindings findings;
  findings.promise = MapPromise{.radius_m = 0.5,
                                .nodes = {{5, 4, 3, 0.8759, 25.46, 0.25, 0.9999},
                                          {4, 4, 0, 0.3, 0.04, 0.0003, 0.7},
                                          {4, 4, 0, 1, 0, 1e9, 0}},
                                .left_out = {{0.2504, 4, 1, 0.4996}}};
  WriteMapFindings(database, findings);
  const auto blob = [&](const std::string& column) {
    SQLite::Statement query(database, "SELECT " + column + " FROM promises");
    EXPECT_TRUE(query.executeStep());
    return query.getColumn(0).getString();
  };
  EXPECT_EQ(blob("nodes"), Varints({10, 1, 3, 875,  999, 255, 500,  //
                                    1,  0, 0, 300,  700, 0,   1,    //
                                    0,  0, 0, 1000, 0,   0,   1'000'000'000})
                               .bytes);
  EXPECT_EQ(blob("left_out"), Varints({250, 500, 4, 1}).bytes);
  EXPECT_EQ(blob("held_out"), "");
  // Without a radius there is nothing to measure by.
  findings.promise->radius_m = 0;
  database.exec("DELETE FROM promises");
  WriteMapFindings(database, findings);
  EXPECT_EQ(blob("nodes"),
            Varints({10, 1, 3, 875, 999, 255, 0, 1, 0, 0, 300, 700, 0, 0, 0, 0, 0, 1000, 0, 0, 0}).bytes);
}

StoredRows HeadRows() {
  StoredRows rows;
  const auto put = [&](const std::string& table, const Values& values) {
    rows[table].emplace_back(std::make_shared<const std::string>("map.cairn: table " + table), 1, values);
  };
  for (const auto& [key, value] :
       std::map<std::string, std::string>{{"name", "kitchen"},
                                          {"seed", "7"},
                                          {"k", "3"},
                                          {"tau", "4"},
                                          {"rho", "5"},
                                          {"sealed", "1"},
                                          {"lower_bound", "2"},
                                          {"uncovered_limit", "6"},
                                          {"stated_pose_sigma_m", "0.5"},
                                          {"stated_pose_sigma_deg", "2.5"},
                                          {"epoch", "18446744073709551615"},
                                          {"covariance_scale", "1.5"},
                                          {"keypoint_correlation", "0.25"},
                                          {"anchor_latitude_deg", "48.5"},
                                          {"anchor_longitude_deg", "9.25"},
                                          {"anchor_altitude_m", "300"},
                                          {"scale_sigma_ratio", "0.01"},
                                          {"scale_centre", "1 2 -3"},
                                          {"stated_camera_9", "PINHOLE 640 480 500 501 320 240"},
                                          {"stated_camera_10", "SIMPLE_PINHOLE 64 48 50 32 24"}})
    put("meta", {T(key), T(value)});
  rows["stage_options"], rows["inputs"];
  put("frames", {T("camera_from_given"), 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3});
  put("frames", {T("later"), T("?"), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0});
  put("frames", {T("floor_from_world"), 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0});
  put("self_test", {T("num_localized"), 3.0});
  BlobWriter params;
  for (const double param : {100.0, 320.0, 240.0}) params.Float64(param);
  put("cameras", {I(4294967295), I(0), I(640), I(480), I(1), StoredBlob{params.Take()}});
  return rows;
}

Result<MapHead> DecodeHead(const std::function<void(StoredRows*)>& change) {
  StoredRows rows = HeadRows();
  change(&rows);
  MapHead head;
  if (const Status status = DecodeMapHead(rows, "map.cairn", &head); !status.ok()) return status.error();
  return head;
}

TEST(HeadRows, AreReadByTheirColumns) {
  const Result<MapHead> head = DecodeHead([](StoredRows*) {});
  ASSERT_TRUE(head.ok()) << head.error().message;
  EXPECT_EQ(head->name, "kitchen");
  EXPECT_EQ(head->seed, 7u);
  EXPECT_EQ(head->k, 3);
  EXPECT_EQ(head->tau, 4);
  EXPECT_EQ(head->rho, 5);
  EXPECT_TRUE(head->sealed);
  EXPECT_EQ(head->lower_bound, 2);
  EXPECT_EQ(head->uncovered_limit, 6);
  EXPECT_EQ(head->stated_pose_sigma_m, 0.5);
  EXPECT_EQ(head->stated_pose_sigma_deg, 2.5);
  EXPECT_EQ(head->epoch, std::numeric_limits<uint64_t>::max());
  EXPECT_EQ(head->covariance_scale, 1.5);
  EXPECT_EQ(head->keypoint_correlation, 0.25);
  EXPECT_EQ(head->frame.anchor->longitude_deg, 9.25);
  EXPECT_FALSE(head->frame.is_reconstructed);
  EXPECT_EQ(head->frame.scale_sigma_ratio, 0.01);
  EXPECT_EQ(head->frame.scale_centre, Eigen::Vector3d(1, 2, -3));
  EXPECT_EQ(head->camera_from_given.translation, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(head->floor_from_world.rotation.x(), 1);
  EXPECT_EQ(head->floor_from_world.translation, Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(head->stated_cameras.size(), 2u);
  EXPECT_EQ(head->stated_cameras[0].camera_id, 9u);  // by number, not by text
  EXPECT_EQ(head->stated_cameras[0].width, 640);
  EXPECT_THAT(head->stated_cameras[0].params, ElementsAre(500, 501, 320, 240));
  EXPECT_EQ(head->stated_cameras[1].camera_id, 10u);
  EXPECT_EQ(head->self_test.at("num_localized"), 3);
  ASSERT_EQ(head->cameras.size(), 1u);
  EXPECT_EQ(head->cameras[0].camera_id, 4294967295u);
  EXPECT_EQ(head->cameras[0].height, 480);
  EXPECT_TRUE(head->cameras[0].has_focal_prior);
  EXPECT_THAT(head->cameras[0].params, ElementsAre(100, 320, 240));
}

TEST(HeadRows, ThatMakeNoSenseAreRefused) {
  const auto meta = [](const std::string& key, const std::string& value) {
    return MessageOf(DecodeHead([&](StoredRows* rows) {
      rows->at("meta").emplace_back(std::make_shared<const std::string>("table meta"), 9,
                                    Values{T(key), T(value)});
    }));
  };
  for (const char* key : {"seed", "k", "tau", "rho"})
    EXPECT_THAT(meta(key, "x"), HasSubstr("is not an integer")) << key;
  for (const char* key : {"lower_bound", "uncovered_limit"})
    EXPECT_THAT(meta(key, "x"), HasSubstr("lower_bound")) << key;
  for (const char* key : {"stated_pose_sigma_m", "stated_pose_sigma_deg"})
    EXPECT_THAT(meta(key, "x"), HasSubstr("is not a number"));
  for (const char* key : {"epoch", "covariance_scale", "keypoint_correlation"})
    EXPECT_THAT(meta(key, "x"), HasSubstr(std::string(key) + " 'x' is not a number that fits"));
  for (const char* key : {"anchor_latitude_deg", "anchor_longitude_deg", "anchor_altitude_m"})
    EXPECT_THAT(meta(key, "x"), HasSubstr("is not three numbers"));
  EXPECT_THAT(meta("scale_sigma_ratio", "x"), HasSubstr("is not one and three numbers"));
  for (const char* centre : {"1 2", "1 2 3 4", "x 2 3", "1 x 3", "1 2 x"})
    EXPECT_THAT(meta("scale_centre", centre), HasSubstr("is not one and three numbers")) << centre;
  EXPECT_THAT(meta("stated_camera_x", "PINHOLE 640 480 500 501 320 240"), HasSubstr("stated_camera_x"));
  EXPECT_THAT(meta("stated_camera_3", "PINHOLE 640 480 500"), HasSubstr("is not a camera"));
  EXPECT_THAT(meta("descriptors", "?"), HasSubstr("table meta"));
  for (const size_t frame : {0, 2}) {
    EXPECT_THAT(MessageOf(DecodeHead([&](StoredRows* rows) {
                  rows->at("frames").erase(rows->at("frames").begin() + static_cast<std::ptrdiff_t>(frame));
                })),
                HasSubstr("table frames lacks floor_from_world or camera_from_given"));
  }
  const auto camera = [](size_t column, const StoredValue& value) {
    return MessageOf(DecodeHead([&](StoredRows* rows) {
      Values values = rows->at("cameras")[0].values();
      values[column] = value;
      rows->at("cameras")[0] = StoredRow(std::make_shared<const std::string>("t"), 1, values);
    }));
  };
  EXPECT_EQ(camera(0, I(0)), "");
  EXPECT_THAT(camera(0, I(-1)), HasSubstr("column 1 is -1, expected 0 to 4294967295"));
  EXPECT_THAT(camera(0, I(4294967296)), HasSubstr("column 1"));
  EXPECT_THAT(camera(1, I(-1)), HasSubstr("camera 4294967295: "));
  EXPECT_THAT(camera(1, I(kMost + 1)), HasSubstr("column 2"));
  for (const size_t column : {2, 3}) {
    EXPECT_EQ(camera(column, I(0)), "");
    EXPECT_EQ(camera(column, I(kMost)), "");
    EXPECT_THAT(camera(column, I(-1)), HasSubstr("is -1, expected 0 to 2147483647"));
    EXPECT_THAT(camera(column, I(kMost + 1)), HasSubstr("expected 0 to 2147483647"));
  }
  EXPECT_THAT(camera(5, StoredBlob{std::string(25, '\0')}),
              HasSubstr("camera 4294967295: 25 bytes of parameters"));
  EXPECT_THAT(camera(5, StoredBlob{std::string(16, '\0')}), HasSubstr("16 bytes of parameters"));
}

std::string VersionRefusal(int version, int major, bool has_writer) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  database.exec("PRAGMA application_id = 1668443504; PRAGMA user_version = " + std::to_string(version));
  if (has_writer)
    database.exec("CREATE TABLE meta (key, value); INSERT INTO meta VALUES ('writer', 'cairn 0.9')");
  return MessageOf(CheckMapVersion(database, "map.cairn", major));
}

TEST(MapVersion, OthersAreNamedWithTheirWriterAndTheRemedy) {
  EXPECT_EQ(VersionRefusal(2000, 2, false), "");
  EXPECT_EQ(VersionRefusal(2999, 2, false), "");
  EXPECT_EQ(VersionRefusal(3007, 2, false), "");
  EXPECT_EQ(VersionRefusal(1005, 1, false), "");
  EXPECT_EQ(VersionRefusal(4012, 2, true),
            "map.cairn: map version 4.12, written by cairn 0.9; 2.x and 3.x is read here. Update the "
            "program, or compile the map with this one.");
  EXPECT_EQ(
      VersionRefusal(1012, 2, false),
      "map.cairn: map version 1.12, written by an unknown program; 2.x and 3.x is read here. Convert it "
      "with `cairn migrate`, or compile the map again.");
  EXPECT_EQ(VersionRefusal(3007, 1, true),
            "map.cairn: map version 3.7, written by cairn 0.9; 1.x is read here. Update the program, or "
            "compile the map with this one.");
  SQLite::Database other(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  EXPECT_EQ(CheckMapVersion(other, "map.cairn", 2).error().code, ErrorCode::kForeignFile);
  EXPECT_THAT(MessageOf(CheckMapVersion(other, "map.cairn", 2)),
              HasSubstr("application_id 0x0, expected 0x63726d70"));
}

TEST(MapEpoch, OnlyALaterMapOfTheNameFollows) {
  MapHead old, next;
  old.name = next.name = "kitchen";
  old.epoch = 3;
  const auto follows = [&](uint64_t epoch, bool allow_older) {
    next.epoch = epoch;
    return MessageOf(CheckFollows(next, "next", old, "old", allow_older));
  };
  EXPECT_EQ(follows(4, false), "");
  EXPECT_THAT(follows(3, false), HasSubstr("next: is of epoch 3, but old of epoch 3"));
  EXPECT_THAT(follows(2, false), HasSubstr("next: is of epoch 2, but old of epoch 3"));
  EXPECT_EQ(follows(2, true), "");
  next.name = "hall";
  EXPECT_THAT(follows(4, true), HasSubstr("next: is map 'hall', but old is map 'kitchen'"));
  EXPECT_EQ(MessageOf(CheckAskedFor(old, "old", "kitchen", 3)), "");
  EXPECT_EQ(MessageOf(CheckAskedFor(old, "old", "", 0)), "");
  EXPECT_THAT(MessageOf(CheckAskedFor(old, "old", "hall", 3)),
              HasSubstr("old: is map 'kitchen', but 'hall' was asked for"));
  EXPECT_THAT(MessageOf(CheckAskedFor(old, "old", "", 4)),
              HasSubstr("old: map 'kitchen' is of epoch 3, but 4 or later was asked for"));
}

TEST(LeftOut, FoldersAreReadAsTheyWereWritten) {
  const std::string folder = testing::TempDir() + "/left_out_rounds";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(WriteLeftOutSummary(folder, 7, 2).ok());
  EXPECT_EQ(*ReadFile(folder + "/left_out.txt"), "7 2\n");
  Result<LeftOutFolder> read = ReadLeftOutFolder(folder);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->num_runs, 7);
  ASSERT_EQ(read->rounds.size(), 2u);
  EXPECT_EQ(read->rounds[0].map_path, folder + "/0.cairn");
  EXPECT_EQ(read->rounds[1].list_path, folder + "/1.txt");
  EXPECT_EQ(read->why_none, "");
  ASSERT_TRUE(WriteNothingLeftOut(folder, "too\nfew").ok());
  EXPECT_EQ(*ReadFile(folder + "/left_out.txt"), "none: too few\n");
  read = ReadLeftOutFolder(folder);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->why_none, "too few");
  EXPECT_TRUE(read->rounds.empty());
  const auto refusal = [&](const std::string& line) {
    EXPECT_TRUE(WriteFileAtomically(folder + "/left_out.txt", line).ok());
    return MessageOf(ReadLeftOutFolder(folder));
  };
  EXPECT_EQ(refusal("1 1"), "");
  EXPECT_EQ(refusal("1 1000\n"), "");
  for (const char* line : {"0 1\n", "1 0\n", "1 1001\n", "-1 1\n", "1\n", "x 1\n", "1 x\n", "1 1 \n", "\n"})
    EXPECT_THAT(refusal(line), HasSubstr("expected two numbers, of runs and of rounds")) << line;
  EXPECT_EQ(ReadLeftOutFolder(folder + "/no").error().code, ErrorCode::kNotFound);
  EXPECT_THAT(MessageOf(ReadLeftOutFolder(folder + "/no")),
              HasSubstr("give the folder that cairn stage leave-out made"));
}

}  // namespace
}  // namespace cairn
