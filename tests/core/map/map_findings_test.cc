#include "core/blocks/map_findings.h"

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/map/map_file.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Two regions, three stations.
MapRows RowsWithFindings() {
  const EmitExample example = MakeEmitExample();
  const emit_map::EmitMapOptions options{
      .landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1};
  MapRows rows =
      *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, options);
  rows.findings.self_test_regions = {{kOutsideRegions, 2, 0, 0, {}},
                                     {1, 4, 3, 1, RegionSelfTest::Errors{0.03, 0.3, 0.8, 8}}};
  rows.findings.region_entropies = {{0, 0.125}, {1, 2.5}};
  rows.findings.drops = {{1, "extract_features", "image", "unreadable", "cannot be read", 3, {}},
                         {44, "decompose_regions", "station", "left_over", "...", 200, {0, 200, 1}}};
  rows.findings.promise = {
      .terms = {.min_matches = 12, .max_error_m = 0.25, .max_error_deg = 3, .probability = 0.9},
      .model = {.match_ratio = 0.75, .shape = 4, .error_ratio = 1.5},
      .radius_m = 0.5,
      .radius_deg = 15,
      .landmarks_lower_bound = 17,
      .nodes = {{0, 0, 1, 0.875, 25.5, 0.125, 0.875},
                {1, 0, 0, 1, 300, 0.001, 1},
                {1, 1, 0, 0, 0, 4000, 0.5}},
      .left_out = {{0, 4, 1, 0.25}, {0.95, 300, 299, 0.999}},
      .held_out = {{0.98, 1, 1, 0.981}}};
  rows.sessions = {"old", "newer", "today"};
  rows.findings.changes = {{1, {-1.25, 2.125, 0.001}, 0.5, 20, 0, 0, -1},
                           {2, {4, 0, 1}, 0.25, 30, 31, -1, -1, 2, 12},
                           {2, {100, -200, 0}, 0, 0, 12, 1, 2}};
  return rows;
}

std::string FindingsPath(const std::string& name) { return testing::TempDir() + "/findings_" + name; }

TEST(MapFindings, RoundTripKeepsEverything) {
  const MapRows rows = RowsWithFindings();
  ASSERT_TRUE(WriteMapRows(rows, FindingsPath("round.cairn")).ok());
  const Result<MapRows> read = ReadMapRows(FindingsPath("round.cairn"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->findings, rows.findings);
}

TEST(MapFindings, RowsThatCannotBeAreNotWritten) {
  const auto error_of = [](const RegionSelfTest& row) {
    MapRows rows = RowsWithFindings();
    rows.findings.self_test_regions = {row};
    const Status status = WriteMapRows(rows, FindingsPath("never.cairn"));
    EXPECT_FALSE(status.ok());
    return status.ok() ? "" : status.error().message;
  };
  EXPECT_THAT(error_of({2, 1, 0, 0, {}}), HasSubstr("region 2 of 2"));
  EXPECT_THAT(error_of({0, 1, 2, 0, RegionSelfTest::Errors{}}), HasSubstr("2 localized of 1"));
  EXPECT_THAT(error_of({0, 2, 1, 2, RegionSelfTest::Errors{}}), HasSubstr("2 gross errors"));
  EXPECT_THAT(error_of({0, 2, 1, 0, {}}), HasSubstr("1 localized"));
  EXPECT_THAT(error_of({0, 2, 1, 0, RegionSelfTest::Errors{-1, 0, 0, 0}}), HasSubstr("an error of -1"));
}

TEST(MapFindings, PromisesThatCannotBeAreNotWritten) {
  const auto error_of = [](const std::function<void(MapPromise*)>& change) {
    MapRows rows = RowsWithFindings();
    change(&*rows.findings.promise);
    const Status status = WriteMapRows(rows, FindingsPath("never.cairn"));
    EXPECT_FALSE(status.ok());
    return status.ok() ? "" : status.error().message;
  };
  const double kInfinity = std::numeric_limits<double>::infinity(), kNan = std::nan("");
  const std::function<void(MapPromise*)> terms[] = {
      [](MapPromise* p) { p->terms.min_matches = 0; },
      [](MapPromise* p) { p->terms.max_error_m = 0; },
      [&](MapPromise* p) { p->terms.max_error_m = kNan; },
      [&](MapPromise* p) { p->terms.max_error_m = kInfinity; },
      [](MapPromise* p) { p->terms.max_error_deg = 0; },
      [&](MapPromise* p) { p->terms.max_error_deg = kInfinity; },
      [](MapPromise* p) { p->terms.probability = 0; },
      [](MapPromise* p) { p->terms.probability = 1; }};
  for (const auto& change : terms) EXPECT_THAT(error_of(change), HasSubstr("map: a promise of "));
  const std::function<void(MapPromise*)> models[] = {[](MapPromise* p) { p->model.match_ratio = -1; },
                                                     [](MapPromise* p) { p->model.shape = 0; },
                                                     [&](MapPromise* p) { p->model.shape = kInfinity; },
                                                     [](MapPromise* p) { p->model.error_ratio = -0.1; },
                                                     [](MapPromise* p) { p->radius_m = -1; },
                                                     [&](MapPromise* p) { p->radius_deg = kNan; },
                                                     [](MapPromise* p) { p->landmarks_lower_bound = -1; }};
  for (const auto& change : models) EXPECT_THAT(error_of(change), HasSubstr("model has impossible numbers"));
  const std::function<void(MapPromise*)> nodes[] = {[](MapPromise* p) { p->nodes[0].image = 99; },
                                                    [](MapPromise* p) { p->nodes[0].other_image = -1; },
                                                    [](MapPromise* p) { p->nodes[0].region = 2; },
                                                    [](MapPromise* p) { p->nodes[0].region = -1; },
                                                    [](MapPromise* p) { p->nodes[0].probability = 1.1; },
                                                    [](MapPromise* p) { p->nodes[0].most_probable = -0.1; },
                                                    [](MapPromise* p) { p->nodes[0].num_matches = -1; },
                                                    [&](MapPromise* p) { p->nodes[0].sigma_m = kNan; }};
  for (const auto& change : nodes) EXPECT_THAT(error_of(change), HasSubstr("between images"));
  const std::function<void(MapPromise*)> curves[] = {
      [](MapPromise* p) { p->left_out[1].least = 0; }, [](MapPromise* p) { p->left_out[0].num = 0; },
      [](MapPromise* p) { p->held_out[0].num_kept = 2; }, [](MapPromise* p) { p->held_out[0].num_kept = -1; },
      [](MapPromise* p) { p->held_out[0].mean_promised = 1.5; }};
  for (const auto& change : curves) EXPECT_THAT(error_of(change), HasSubstr("kept"));
}

TEST(MapFindings, ChangesThatCannotBeAreNotWritten) {
  const auto error_of = [](const std::function<void(MapRows*)>& change) {
    MapRows rows = RowsWithFindings();
    change(&rows);
    const Status status = WriteMapRows(rows, FindingsPath("never.cairn"));
    EXPECT_FALSE(status.ok());
    return status.ok() ? "" : status.error().message;
  };
  const double kInfinity = std::numeric_limits<double>::infinity(), kNan = std::nan("");
  const auto changes = [](MapRows* rows) -> std::vector<MapChange>& { return rows->findings.changes; };
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[0].session = 0; }), HasSubstr("session 0 of 3"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[2].session = 3; }), HasSubstr("session 3 of 3"));
  EXPECT_THAT(error_of([&](MapRows* r) { r->sessions.clear(); }), HasSubstr("session 1 of 0"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[0].image_before = 3; }),
              HasSubstr("images 3 and -1 of 3"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[0].image_after = -2; }), HasSubstr("images 0 and -2"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].moved_to = 3; }), HasSubstr("moved to change 3 of 3"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].moved_to = 0; }), HasSubstr("moved to change 0"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].moved_to = -1; }), HasSubstr("moved to change -1"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[0].moved_to = -2; }), HasSubstr("moved to change -2"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].num_moved = 0; }), HasSubstr("0 features of 30"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].num_moved = -1; }), HasSubstr("-1 features of 30"));
  EXPECT_THAT(error_of([&](MapRows* r) { changes(r)[1].num_moved = 31; }), HasSubstr("31 features of 30"));
  const std::function<void(MapChange*)> numbers[] = {
      [&](MapChange* c) { c->position.y() = kNan; }, [&](MapChange* c) { c->position.z() = -kInfinity; },
      [](MapChange* c) { c->position.x() = 3e5; },   [&](MapChange* c) { c->radius_m = kNan; },
      [](MapChange* c) { c->radius_m = -0.1; },      [&](MapChange* c) { c->radius_m = kInfinity; },
      [](MapChange* c) { c->num_vanished = -1; },    [](MapChange* c) { c->num_appeared = -1; },
      [](MapChange* c) { c->num_vanished = 0; }};
  for (const auto& change : numbers)
    EXPECT_THAT(error_of([&](MapRows* r) { change(&changes(r)[0]); }), HasSubstr("change 0: "));
  EXPECT_THAT(error_of([&](MapRows* r) { std::swap(changes(r)[0], changes(r)[1]); }),
              HasSubstr("out of order"));
  EXPECT_THAT(error_of([&](MapRows* r) { std::swap(changes(r)[1], changes(r)[2]); }),
              HasSubstr("out of order"));
}

// A map of one survey, or of a place where nothing changed, has the bytes that it had before changes were
// kept.
TEST(MapFindings, WithoutChangesThereIsNoTableOfThem) {
  const auto has_table = [](const MapRows& rows) {
    EXPECT_TRUE(WriteMapRows(rows, FindingsPath("unchanged.cairn")).ok());
    SQLite::Database database(FindingsPath("unchanged.cairn"), SQLite::OPEN_READONLY);
    return HasTable(database, "changes");
  };
  MapRows rows = RowsWithFindings();
  EXPECT_TRUE(has_table(rows));
  rows.findings.changes.clear();
  EXPECT_FALSE(has_table(rows));
  EXPECT_THAT(ReadMapRows(FindingsPath("unchanged.cairn"))->findings.changes, IsEmpty());
}

TEST(MapPromise, CountsTheNodesThatKeepIt) { EXPECT_EQ(RowsWithFindings().findings.promise->NumKept(), 1); }

TEST(MapFindings, DamagedRowsAreRefused) {
  for (const char* sql :
       {"UPDATE self_test_regions SET region_idx = 2 WHERE region_idx = 1",
        "UPDATE self_test_regions SET region_idx = -2 WHERE region_idx = 1",
        "UPDATE self_test_regions SET region_idx = 4294967297 WHERE region_idx = 1",
        "UPDATE self_test_regions SET num_held_out = 0",
        "UPDATE self_test_regions SET num_held_out = 4294967300",
        "UPDATE self_test_regions SET num_localized = 'x'",
        "UPDATE self_test_regions SET num_gross_errors = 4",
        "UPDATE self_test_regions SET median_error_m = NULL",
        "UPDATE self_test_regions SET p90_error_deg = 9e999",
        "UPDATE region_entropies SET region_idx = 2 WHERE region_idx = 1",
        "UPDATE region_entropies SET region_idx = -1 WHERE region_idx = 1",
        "UPDATE region_entropies SET entropy = -1", "UPDATE region_entropies SET entropy = 9e999",
        "UPDATE drop_reasons SET reason_id = -1 WHERE reason_id = 1",
        "UPDATE drop_reasons SET num_dropped = 0",
        "UPDATE drop_reasons SET num_dropped = 199 WHERE reason_id = 44",
        "UPDATE drop_reasons SET at_stations = x'0000'",
        "UPDATE drop_reasons SET at_stations = x'0000ff' WHERE reason_id = 44",
        "UPDATE drop_reasons SET at_stations = x'0000ffffffff7f' WHERE reason_id = 44",
        "UPDATE promises SET min_matches = 0", "UPDATE promises SET probability = 2",
        "UPDATE promises SET max_error_m = 'x'", "UPDATE promises SET landmarks_bound = -1",
        "UPDATE promises SET nodes = 1", "UPDATE promises SET nodes = x'00'",
        // images 0 and 0, region 0, probability 2000 / 1000
        "UPDATE promises SET nodes = x'000000d00f000000'",
        // images -1, and 2^31
        "UPDATE promises SET nodes = x'01000000000000'",
        "UPDATE promises SET nodes = x'808080801000000000000000'", "UPDATE promises SET left_out = x'00'",
        "UPDATE promises SET held_out = x'00000001'",
        "INSERT INTO promises SELECT 1, min_matches, max_error_m, max_error_deg, probability, match_ratio, "
        "shape, "
        "error_ratio, radius_m, radius_deg, landmarks_bound, nodes, left_out, held_out FROM promises",
        "UPDATE changes SET session_idx = 0 WHERE change_idx = 0",
        "UPDATE changes SET session_idx = 3 WHERE change_idx = 2",
        "UPDATE changes SET session_idx = 4294967297 WHERE change_idx = 0",
        "UPDATE changes SET change_idx = 7 WHERE change_idx = 0",
        "UPDATE changes SET x = 'x' WHERE change_idx = 0", "UPDATE changes SET y = 0.5 WHERE change_idx = 0",
        "UPDATE changes SET z = 200000001 WHERE change_idx = 0",
        "UPDATE changes SET z = 9223372036854775807 WHERE change_idx = 0",
        "UPDATE changes SET radius = -1 WHERE change_idx = 0",
        "UPDATE changes SET num_vanished = 0 WHERE change_idx = 0",
        "UPDATE changes SET num_appeared = 4294967300 WHERE change_idx = 0",
        "UPDATE changes SET image_before = 3 WHERE change_idx = 0",
        "UPDATE changes SET image_after = -2 WHERE change_idx = 0", "UPDATE moves SET change_idx = 3",
        "UPDATE moves SET change_idx = -1", "UPDATE moves SET moved_to = 0",
        "UPDATE moves SET moved_to = 4294967298", "UPDATE moves SET num_features = 0",
        "UPDATE moves SET num_features = 31", "INSERT INTO moves VALUES (0, -1, 5)", "DELETE FROM changes",
        "ALTER TABLE moves DROP COLUMN num_features", "ALTER TABLE changes DROP COLUMN image_after",
        "ALTER TABLE promises DROP COLUMN shape", "ALTER TABLE drop_reasons DROP COLUMN text",
        "ALTER TABLE self_test_regions DROP COLUMN p90_error_m",
        "ALTER TABLE self_test_regions ADD COLUMN late REAL AS (p90_error_m + 1)",
        "DROP TABLE drop_reasons; CREATE VIRTUAL TABLE drop_reasons USING fts5(reason_id)"}) {
    ASSERT_TRUE(WriteMapRows(RowsWithFindings(), FindingsPath("damaged.cairn")).ok());
    SQLite::Database(FindingsPath("damaged.cairn"), SQLite::OPEN_READWRITE).exec(sql);
    const Result<MapRows> read = ReadMapRows(FindingsPath("damaged.cairn"));
    ASSERT_FALSE(read.ok()) << sql;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << sql;
    std::filesystem::remove(FindingsPath("damaged.cairn"));
  }
}

// Version 2.1 as the program of that version wrote the rows above.
TEST(GoldenMap, Version2_1IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.1.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  MapFindings expected = RowsWithFindings().findings;
  expected.region_entropies.clear();  // came with 2.3
  expected.promise.reset();           // came with 2.6
  expected.changes.clear();           // came with 2.7
  EXPECT_EQ(rows->findings, expected);
  EXPECT_THAT(rows->regions[1].landmarks, ElementsAre(0, 2));
  EXPECT_NEAR(rows->landmarks[0].position.x(), 2.1234, 1e-12);
  EXPECT_EQ(rows->descriptors(1, 0), 30);
  EXPECT_EQ(rows->vocabulary.num_words(), 1);
}

TEST(MapFindings, MapOfAFormatWithoutTheTablesHasNone) {
  const Result<MapRows> read = ReadMapRows(GOLDEN_DIR "/map_2.0.cairn");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->findings, MapFindings());
}

TEST(MapFindings, ChangedOrMissingFindingsAreRefused) {
  for (const char* const sql :
       {"DROP TABLE self_test_regions", "DROP TABLE region_entropies; DROP TABLE drop_reasons",
        "UPDATE drop_reasons SET num_dropped = num_dropped + 1", "DROP TABLE promises", "DROP TABLE changes",
        "UPDATE changes SET num_vanished = num_vanished + 1 WHERE change_idx = 0",
        "UPDATE promises SET shape = shape + 1"}) {
    ASSERT_TRUE(WriteMapRows(RowsWithFindings(), FindingsPath("changed.cairn")).ok());
    SQLite::Database(FindingsPath("changed.cairn"), SQLite::OPEN_READWRITE).exec(sql);
    const Result<MapFile> file =
        MapFile::Open(FindingsPath("changed.cairn"), {});  // which does not read them
    ASSERT_TRUE(file.ok()) << file.error().message;
    EXPECT_EQ(file->ReadFindings().error().code, ErrorCode::kCorrupt) << sql;
  }
}

}  // namespace
}  // namespace cairn
