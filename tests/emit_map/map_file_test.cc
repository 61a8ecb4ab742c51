#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/database.h"
#include "core/file.h"
#include "core/map_rows.h"
#include "stages/emit_map/emit_map.h"
#include "tests/emit_map/example.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

MapRows ExampleRows() {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, {});
  rows.name = "example";
  rows.writer = "cairn test";
  rows.seed = 18446744073709551615u;
  rows.stage_options["emit_map"] = "landmarks = \"regions\"\n";
  rows.input_hashes["world.db"] = "0123";
  rows.self_test["num_localized"] = 3;
  rows.camera_from_given.translation = {0.1, -0.2, 0.3};
  return rows;
}

std::string MapPath(const std::string& name) { return testing::TempDir() + "/" + name; }

TEST(MapFile, RoundTripKeepsEverything) {
  const MapRows written = ExampleRows();
  ASSERT_TRUE(WriteMapRows(written, MapPath("round.cairn")).ok());
  const Result<MapRows> read = ReadMapRows(MapPath("round.cairn"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->name, "example");
  EXPECT_EQ(read->writer, "cairn test");
  EXPECT_EQ(read->seed, written.seed);
  EXPECT_EQ(read->k, 2);
  EXPECT_EQ(read->algorithm, "b2");
  EXPECT_EQ(read->lower_bound, 2);
  EXPECT_EQ(read->uncovered_limit, 1);
  EXPECT_EQ(read->stage_options, written.stage_options);
  EXPECT_EQ(read->input_hashes, written.input_hashes);
  EXPECT_EQ(read->self_test, written.self_test);
  EXPECT_EQ(read->camera_from_given.translation, written.camera_from_given.translation);
  EXPECT_EQ(read->cameras[0].params, written.cameras[0].params);
  EXPECT_EQ(read->station_edges, written.station_edges);
  EXPECT_EQ(read->stations[1].heading_deg, written.stations[1].heading_deg);
  EXPECT_FALSE(read->stations[2].is_covered);
  EXPECT_EQ(read->regions[1].landmarks, written.regions[1].landmarks);
  EXPECT_EQ(read->images[1].landmarks, written.images[1].landmarks);
  EXPECT_EQ(read->images[2].station, 2);
  EXPECT_EQ(read->descriptors, written.descriptors);
  EXPECT_EQ(read->vocabulary.inverted_files, written.vocabulary.inverted_files);
  EXPECT_NEAR(read->landmarks[0].covariance(1, 1), 2e-4, 1e-10);
}

TEST(MapFile, MapWithoutALowerBoundHasNone) {
  MapRows rows = ExampleRows();
  rows.lower_bound.reset();
  ASSERT_TRUE(WriteMapRows(rows, MapPath("unbounded.cairn")).ok());
  EXPECT_FALSE(ReadMapRows(MapPath("unbounded.cairn"))->lower_bound.has_value());
}

TEST(MapFile, PositionsAreQuantisedToATenthOfAMillimetre) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("quantised.cairn")).ok());
  const MapRows read = *ReadMapRows(MapPath("quantised.cairn"));
  EXPECT_NEAR(read.landmarks[0].position.x(), 2.1234, 1e-12);  // 2.12344 m
}

TEST(MapFile, WritingWhatWasReadGivesTheSameBytes) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("first.cairn")).ok());
  std::filesystem::remove(MapPath("second.cairn"));
  ASSERT_TRUE(WriteMapRows(*ReadMapRows(MapPath("first.cairn")), MapPath("second.cairn")).ok());
  EXPECT_EQ(*ReadFile(MapPath("first.cairn")), *ReadFile(MapPath("second.cairn")));
}

TEST(MapFile, InvalidRowsAreNotWritten) {
  const std::string path = MapPath("invalid.cairn");
  MapRows rows = ExampleRows();
  rows.regions[0].landmarks = {0, 99};
  EXPECT_EQ(WriteMapRows(rows, path).error().code, ErrorCode::kInvalidArgument);
  rows = ExampleRows();
  rows.landmarks[0].position.x() = std::nan("");
  EXPECT_EQ(WriteMapRows(rows, path).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(MapFile, MissingFileIsNotFound) {
  EXPECT_EQ(ReadMapRows(MapPath("nowhere.cairn")).error().code, ErrorCode::kNotFound);
}

TEST(MapFile, OtherFilesAreRefused) {
  ASSERT_TRUE(WriteFileAtomically(MapPath("text.cairn"), "this is no map").ok());
  EXPECT_EQ(ReadMapRows(MapPath("text.cairn")).error().code, ErrorCode::kCorrupt);
  ASSERT_TRUE(WriteFileAtomically(MapPath("empty.cairn"), "").ok());
  EXPECT_EQ(ReadMapRows(MapPath("empty.cairn")).error().code, ErrorCode::kCorrupt);
  ASSERT_TRUE(WriteVocabulary(MakeEmitExample().vocabulary, MapPath("vocabulary.cairn")).ok());
  const Error error = ReadMapRows(MapPath("vocabulary.cairn")).error();
  EXPECT_EQ(error.code, ErrorCode::kCorrupt);
  EXPECT_THAT(error.message, HasSubstr("not a cairn map"));
}

TEST(MapFile, EveryTruncationIsRefused) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("whole.cairn")).ok());
  const std::string bytes = *ReadFile(MapPath("whole.cairn"));
  for (size_t size = 0; size < bytes.size(); size += 1024) {
    ASSERT_TRUE(WriteFileAtomically(MapPath("cut.cairn"), bytes.substr(0, size)).ok());
    const Result<MapRows> read = ReadMapRows(MapPath("cut.cairn"));
    ASSERT_FALSE(read.ok()) << size;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << size << ": " << read.error().message;
  }
}

TEST(MapFile, NewerMajorVersionNamesTheWriter) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("newer.cairn")).ok());
  SQLite::Database(MapPath("newer.cairn"), SQLite::OPEN_READWRITE).exec("PRAGMA user_version = 2003");
  const Error error = ReadMapRows(MapPath("newer.cairn")).error();
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_THAT(error.message, HasSubstr("2.3, written by cairn test"));
}

TEST(MapFile, NewerMinorVersionIsRead) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("minor.cairn")).ok());
  SQLite::Database(MapPath("minor.cairn"), SQLite::OPEN_READWRITE)
      .exec(
          "PRAGMA user_version = 1007; CREATE TABLE later (x); ALTER TABLE landmarks ADD COLUMN later "
          "INTEGER;");
  EXPECT_TRUE(ReadMapRows(MapPath("minor.cairn")).ok());
}

TEST(MapFile, DamagedRowsAreRefused) {
  for (const char* sql : {"DELETE FROM landmarks WHERE landmark_idx = 1",
                          "UPDATE landmarks SET descriptor = x'00'",
                          "UPDATE landmarks SET covariance = x'0000'",
                          "UPDATE landmarks SET x = 9000000000000",
                          "UPDATE regions SET landmarks = x'7f'",
                          "UPDATE regions SET num_landmarks = 1000000000000",
                          "UPDATE regions SET region_idx = 7 WHERE region_idx = 1",
                          "UPDATE images SET camera_id = 8",
                          "UPDATE images SET qw = 0.5",
                          "UPDATE images SET tx = 9e999",
                          "UPDATE images SET station_idx = 3",
                          "UPDATE images SET landmarks = x'ffffffffffffffffffff01'",
                          "UPDATE stations SET neighbours = x'01'",
                          "UPDATE stations SET x = 9e999",
                          "UPDATE cameras SET params = x'00'",
                          "UPDATE cameras SET model = 55",
                          "UPDATE cameras SET width = -3",
                          "DELETE FROM frames",
                          "DELETE FROM meta",
                          "UPDATE meta SET value = 'x'",
                          "UPDATE meta SET value = 'x' WHERE key = 'lower_bound'",
                          "UPDATE meta SET value = 3 WHERE key = 'lower_bound'",
                          "UPDATE meta SET value = -1 WHERE key = 'uncovered_limit'",
                          "DELETE FROM meta WHERE key = 'uncovered_limit'",
                          "DELETE FROM images WHERE image_id = 2",
                          "DROP TABLE landmarks",
                          "DROP TABLE vocabulary_words"}) {
    ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("damaged.cairn")).ok());
    SQLite::Database(MapPath("damaged.cairn"), SQLite::OPEN_READWRITE).exec(sql);
    const Result<MapRows> read = ReadMapRows(MapPath("damaged.cairn"));
    ASSERT_FALSE(read.ok()) << sql;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << sql;
    EXPECT_THAT(read.error().message, HasSubstr("damaged.cairn")) << sql;
    std::filesystem::remove(MapPath("damaged.cairn"));
  }
}

}  // namespace
}  // namespace cairn
