#include <cmath>
#include <filesystem>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

MapRows ExampleRows() {
  const EmitExample example = MakeEmitExample();
  const emit_map::EmitMapOptions options{
      .landmarks = "regions", .min_num_landmarks_for_words = 0, .landmarks_per_word = 1};
  MapRows rows =
      *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary, options);
  rows.name = "example";
  rows.writer = "cairn test";
  rows.seed = 18446744073709551615u;
  rows.stage_options["emit_map"] = "landmarks = \"regions\"\n";
  rows.input_hashes["world.db"] = "0123";
  rows.self_test["num_localized"] = 3;
  rows.camera_from_given.translation = {0.1, -0.2, 0.3};
  rows.camera_from_given.rotation = Eigen::Quaterniond(0.1, -0.2, 0.5, 0.7).normalized();
  rows.floor_from_world.translation = {-1.5, 2.5, 0.25};
  rows.floor_from_world.rotation = Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2).normalized();
  rows.stated_pose_sigma_m = 0.02;
  rows.stated_pose_sigma_deg = 1.5;
  rows.covariance_scale = 1.23456789;
  rows.keypoint_correlation = 0.0123456789;
  rows.stated_cameras = {rows.cameras[0]};
  rows.stated_cameras[0].model = CameraModel::kSimplePinhole;
  rows.stated_cameras[0].params = {301.23456789, 1.0 / 3, 240};
  rows.frame.anchor = GeodeticPosition{55.7, 13.2, 40.5};
  rows.frame.source = "gps";
  rows.frame.is_reconstructed = true;
  rows.frame.scale_sigma_ratio = 0.0123456789;
  rows.frame.scale_centre = {1.0 / 3, -2, 1e-9};
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
  for (const auto pose : {&MapRows::camera_from_given, &MapRows::floor_from_world}) {
    EXPECT_EQ(((*read).*pose).translation, (written.*pose).translation);
    EXPECT_TRUE(((*read).*pose).rotation.isApprox((written.*pose).rotation, 1e-12));
  }
  EXPECT_EQ(read->stated_pose_sigma_m, 0.02);
  EXPECT_EQ(read->stated_pose_sigma_deg, 1.5);
  EXPECT_EQ(read->covariance_scale, 1.23456789);
  EXPECT_EQ(read->keypoint_correlation, 0.0123456789);
  ASSERT_EQ(read->stated_cameras.size(), 1u);
  EXPECT_EQ(read->stated_cameras[0].camera_id, written.cameras[0].camera_id);
  EXPECT_EQ(read->stated_cameras[0].model, CameraModel::kSimplePinhole);
  EXPECT_EQ(read->stated_cameras[0].width, written.cameras[0].width);
  EXPECT_EQ(read->stated_cameras[0].params, written.stated_cameras[0].params);
  ASSERT_TRUE(read->frame.anchor);
  EXPECT_EQ(read->frame.anchor->latitude_deg, 55.7);
  EXPECT_EQ(read->frame.anchor->longitude_deg, 13.2);
  EXPECT_EQ(read->frame.anchor->altitude_m, 40.5);
  EXPECT_EQ(read->frame.source, "gps");
  EXPECT_TRUE(read->frame.is_reconstructed);
  EXPECT_EQ(read->frame.scale_sigma_ratio, 0.0123456789);
  EXPECT_EQ(read->frame.scale_centre, Eigen::Vector3d(1.0 / 3, -2, 1e-9));
  EXPECT_EQ(read->cameras[0].params, written.cameras[0].params);
  EXPECT_EQ(read->station_edges, written.station_edges);
  EXPECT_EQ(read->stations[1].heading_deg, written.stations[1].heading_deg);
  EXPECT_FALSE(read->stations[2].is_covered);
  EXPECT_EQ(read->regions[1].landmarks, written.regions[1].landmarks);
  EXPECT_EQ(read->images[1].landmarks, written.images[1].landmarks);
  EXPECT_EQ(read->images[2].station, 2);
  EXPECT_EQ(read->descriptors, written.descriptors);
  EXPECT_EQ(read->vocabulary.inverted_files, written.vocabulary.inverted_files);
  EXPECT_EQ(read->regions[1].stations, written.regions[1].stations);
  EXPECT_EQ(read->vocabulary.document_ids, written.vocabulary.document_ids);
  EXPECT_EQ(read->vocabulary.centres, written.vocabulary.centres);
  EXPECT_EQ(read->images[1].name, "image2.png");
  EXPECT_EQ(read->landmarks[2].class_id, 10u);
  EXPECT_EQ(read->landmarks[2].num_observations, 2);
  // Standard deviations and sizes within 4.5 %.
  EXPECT_NEAR(std::sqrt(read->landmarks[0].covariance(1, 1) / 2e-4), 1, 0.045);
  EXPECT_NEAR(read->landmarks[0].scale_m / written.landmarks[0].scale_m, 1, 0.045);
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
  std::filesystem::remove(path);
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

TEST(MapFile, EveryKindOfOtherFileHasItsCode) {
  const std::string path = MapPath("other.cairn");
  const auto code = [&] { return ReadMapRows(path).error().code; };
  ASSERT_TRUE(WriteFileAtomically(path, "this is no map").ok());
  EXPECT_EQ(code(), ErrorCode::kNotSqlite);
  ASSERT_TRUE(WriteFileAtomically(path, "").ok());
  EXPECT_EQ(code(), ErrorCode::kEmptyFile);
  ASSERT_TRUE(WriteVocabulary(MakeEmitExample().vocabulary, path).ok());
  EXPECT_EQ(code(), ErrorCode::kForeignFile);
  EXPECT_THAT(ReadMapRows(path).error().message, HasSubstr("not a cairn map"));
  EXPECT_EQ(ReadMapRows(testing::TempDir()).error().code, ErrorCode::kNotSqlite);
}

TEST(MapFile, EveryTruncationIsRefused) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("whole.cairn")).ok());
  const std::string bytes = *ReadFile(MapPath("whole.cairn"));
  for (size_t size = 0; size < bytes.size(); size += 512) {
    ASSERT_TRUE(WriteFileAtomically(MapPath("cut.cairn"), bytes.substr(0, size)).ok());
    const Result<MapRows> read = ReadMapRows(MapPath("cut.cairn"));
    ASSERT_FALSE(read.ok()) << size;
    EXPECT_EQ(read.error().code, size == 0 ? ErrorCode::kEmptyFile : ErrorCode::kTruncated) << size;
  }
  ASSERT_TRUE(WriteFileAtomically(MapPath("longer.cairn"), bytes + std::string(1024, '\0')).ok());
  EXPECT_EQ(ReadMapRows(MapPath("longer.cairn")).error().code, ErrorCode::kCorrupt);
}

TEST(MapFile, NewerMajorVersionNamesTheWriter) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("newer.cairn")).ok());
  SQLite::Database(MapPath("newer.cairn"), SQLite::OPEN_READWRITE).exec("PRAGMA user_version = 4003");
  const Error error = ReadMapRows(MapPath("newer.cairn")).error();
  EXPECT_EQ(error.code, ErrorCode::kTooNew);
  EXPECT_THAT(error.message, HasSubstr("4.3, written by cairn test"));
  EXPECT_THAT(error.message, HasSubstr("Update the program"));
}

// Floating-point descriptors of 100 values, not whole bytes of a block at 3 bits each, and binary ones.
TEST(MapFile, DescriptorsOfOtherKindsAreReadAsTheyWereWritten) {
  for (const DescriptorKind& kind : {DescriptorKind{DescriptorType::kFloat, 101, "net"},
                                     DescriptorKind{DescriptorType::kBinary, 488, ""}}) {
    MapRows rows = ExampleRows();
    rows.descriptor_kind = kind;
    rows.descriptor_code.reset();
    const auto num = static_cast<Eigen::Index>(rows.landmarks.size());
    const int unit = kind.type == DescriptorType::kBinary ? 2 * kind.space().offset : 40;
    rows.descriptors.resize(num, kind.num_values);
    for (Eigen::Index i = 0; i < rows.descriptors.size(); ++i)
      rows.descriptors.data()[i] =
          static_cast<uint8_t>(unit * (i * 7 % 11 % (kind.type == DescriptorType::kBinary ? 2 : 5)));
    rows.vocabulary = {};
    ASSERT_TRUE(WriteMapRows(rows, MapPath("kind.cairn")).ok());
    EXPECT_EQ(SQLite::Database(MapPath("kind.cairn")).execAndGet("PRAGMA user_version").getInt(), 3008);
    const Result<MapRows> read = ReadMapRows(MapPath("kind.cairn"));
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->descriptor_kind, kind);
    EXPECT_EQ(read->descriptors, rows.descriptors);
  }
}

TEST(MapFile, DescriptorsOfAnotherWidthThanTheirKindAreNotWritten) {
  MapRows rows = ExampleRows();
  rows.descriptor_kind = {DescriptorType::kFloat, 64, ""};
  EXPECT_EQ(WriteMapRows(rows, MapPath("wrong.cairn")).error().code, ErrorCode::kInvalidArgument);
}

TEST(MapFile, NewerMinorVersionIsRead) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("minor.cairn")).ok());
  SQLite::Database(MapPath("minor.cairn"), SQLite::OPEN_READWRITE)
      .exec("PRAGMA user_version = 2099; CREATE TABLE later (x); INSERT INTO later VALUES (1);");
  const Result<MapRows> read = ReadMapRows(MapPath("minor.cairn"));
  EXPECT_TRUE(read.ok()) << read.error().message;
}

TEST(MapFile, ChangedRowsAreRefused) {
  for (const char* sql :
       {"UPDATE meta SET value = 'x' WHERE key = 'name'", "UPDATE self_test SET value = value + 1",
        "UPDATE cameras SET width = -3", "DELETE FROM frames",
        "UPDATE blocks SET bytes = x'00' WHERE block_idx = 0", "DELETE FROM blocks WHERE block_idx = 1",
        "UPDATE directory SET entries = substr(entries, 70)", "DELETE FROM directory",
        "UPDATE seal SET seal = zeroblob(176)", "DROP TABLE blocks",
        "ALTER TABLE meta RENAME TO old; CREATE VIEW meta AS SELECT * FROM old",
        "ALTER TABLE meta ADD COLUMN later AS (zeroblob(100000000))"}) {
    ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("damaged.cairn")).ok());
    SQLite::Database(MapPath("damaged.cairn"), SQLite::OPEN_READWRITE).exec(sql);
    const Result<MapRows> read = ReadMapRows(MapPath("damaged.cairn"));
    ASSERT_FALSE(read.ok()) << sql;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt) << sql << read.error().message;
    EXPECT_THAT(read.error().message, HasSubstr("damaged.cairn")) << sql;
    std::filesystem::remove(MapPath("damaged.cairn"));
  }
}

TEST(MapFile, TablesOfTooFewColumnsAreRefused) {
  const std::string path = MapPath("narrow.cairn");
  ASSERT_TRUE(WriteMapRows(ExampleRows(), path).ok());
  SQLite::Database(path, SQLite::OPEN_READWRITE)
      .exec(
          "CREATE TABLE narrow AS SELECT key FROM meta; DROP TABLE meta; ALTER TABLE narrow RENAME TO meta");
  const Result<MapRows> read = ReadMapRows(path);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(read.error().message, HasSubstr("table meta has 1 columns, expected 2"));
}

TEST(MapFile, SparseMapsReadBackAsTheyWere) {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                    {.landmarks = "regions",
                                     .min_num_landmarks_for_words = 0,
                                     .landmarks_per_word = 1,
                                     .documents = "kept"},
                                    &example.appearance);
  ASSERT_TRUE(WriteMapRows(rows, MapPath("sparse.cairn")).ok());
  const Result<MapRows> read = ReadMapRows(MapPath("sparse.cairn"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->documents, "kept");
  EXPECT_EQ(read->appearance, rows.appearance);
  EXPECT_EQ(read->vocabulary.document_ids, rows.vocabulary.document_ids);
  EXPECT_EQ(read->vocabulary.inverted_files, rows.vocabulary.inverted_files);
  EXPECT_EQ(read->vocabulary.document_norms, rows.vocabulary.document_norms);

  MapRows wrong = rows;
  wrong.appearance[1].entropy = std::nullopt;
  EXPECT_FALSE(WriteMapRows(wrong, MapPath("sparse.cairn")).ok()) << "a node without entropy";
  wrong = rows;
  wrong.appearance[0].look_alikes = {{0, 0.5}};
  EXPECT_FALSE(WriteMapRows(wrong, MapPath("sparse.cairn")).ok()) << "a node like itself";
  rows.appearance[0].images = {1};
  EXPECT_FALSE(WriteMapRows(rows, MapPath("sparse.cairn")).ok()) << "image 1 is of two nodes";
  rows.appearance.clear();
  EXPECT_FALSE(WriteMapRows(rows, MapPath("sparse.cairn")).ok()) << "nothing is kept";
}

TEST(MapFile, FloorPlansReadBackAsTheyWere) {
  MapRows rows = ExampleRows();
  rows.views = MakeExampleViews();
  ASSERT_TRUE(WriteMapRows(rows, MapPath("plan.cairn")).ok());
  const Result<MapRows> read = ReadMapRows(MapPath("plan.cairn"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  const Views& found = read->views;
  EXPECT_EQ(found.plan.vertices, rows.views.plan.vertices);
  EXPECT_EQ(found.plan.walls[2].end, rows.views.plan.walls[2].end);
  EXPECT_EQ(found.vertices, rows.views.vertices);
  EXPECT_EQ(found.face_vertices, rows.views.face_vertices);
  EXPECT_EQ(found.parents, rows.views.parents);
  EXPECT_THAT(found.LabelSet(1), ElementsAre(0, 4, 6));
  EXPECT_EQ(found.index[1].visible_area_m2, 1.5F);
  EXPECT_EQ(found.links, rows.views.links);
  std::filesystem::remove(MapPath("plan2.cairn"));
  ASSERT_TRUE(WriteMapRows(*read, MapPath("plan2.cairn")).ok());
  EXPECT_EQ(*ReadFile(MapPath("plan.cairn")), *ReadFile(MapPath("plan2.cairn")));

  // The walls alone.
  FloorPlan walls = rows.views.plan;
  rows.views = Views();
  rows.views.plan = walls;
  ASSERT_TRUE(WriteMapRows(rows, MapPath("walls.cairn")).ok());
  const Result<MapRows> bare = ReadMapRows(MapPath("walls.cairn"));
  ASSERT_TRUE(bare.ok()) << bare.error().message;
  EXPECT_EQ(bare->views.plan.walls.size(), walls.walls.size());
  EXPECT_EQ(bare->views.num_faces(), 0);
  rows.views = MakeExampleViews();
  rows.views.plan.walls.clear();
  rows.views.plan.pieces.clear();
  EXPECT_FALSE(WriteMapRows(rows, MapPath("walls.cairn")).ok()) << "regions without walls";

  rows.views = MakeExampleViews();
  rows.views.parents[1] = 1;
  EXPECT_FALSE(WriteMapRows(rows, MapPath("plan.cairn")).ok()) << "a region is its own parent";
  rows.views = MakeExampleViews();
  std::swap(rows.views.face_vertices[0], rows.views.face_vertices[3]);
  EXPECT_FALSE(WriteMapRows(rows, MapPath("plan.cairn")).ok()) << "vertices are not numbered by use";
}

TEST(MapFile, VisualMapsReadBackAsTheyWere) {
  MapRows rows = ExampleRows();
  ASSERT_TRUE(WriteMapRows(rows, MapPath("without.cairn")).ok());
  rows.visual_map = MakeExampleVisualMap();
  ASSERT_TRUE(WriteMapRows(rows, MapPath("visual.cairn")).ok());
  const Result<MapRows> read = ReadMapRows(MapPath("visual.cairn"));
  ASSERT_TRUE(read.ok()) << read.error().message;
  const VisualMapData& found = read->visual_map;
  EXPECT_EQ(found.camera_id, 3u);
  EXPECT_EQ(found.focal_px, 321.5F);
  EXPECT_EQ(found.headings_deg, rows.visual_map.headings_deg);
  EXPECT_EQ(found.errors, rows.visual_map.errors);
  ASSERT_EQ(found.landmarks.size(), 3u);
  EXPECT_TRUE(found.landmarks[1].empty());
  ASSERT_EQ(found.landmarks[2].size(), 2u);
  const HeadingModel& model = found.landmarks[2][1];
  EXPECT_EQ(model.heading, 2);
  EXPECT_EQ(model.shape, (KernelShape{2, 3}));
  EXPECT_TRUE(model.predicts_badly);
  EXPECT_EQ(model.sights, rows.visual_map.landmarks[2][1].sights);
  EXPECT_EQ(model.sigma, rows.visual_map.landmarks[2][1].sigma);
  ASSERT_TRUE(WriteMapRows(*read, MapPath("visual2.cairn")).ok());
  EXPECT_EQ(*ReadFile(MapPath("visual.cairn")), *ReadFile(MapPath("visual2.cairn")));
  // Without this option the map is the same as before.
  rows.visual_map = {};
  ASSERT_TRUE(WriteMapRows(rows, MapPath("without2.cairn")).ok());
  EXPECT_EQ(*ReadFile(MapPath("without.cairn")), *ReadFile(MapPath("without2.cairn")));
}

TEST(MapFile, VisualMapsThatMakeNoSenseAreNotWritten) {
  for (const auto& change : std::vector<std::function<void(VisualMapData&)>>{
           [](VisualMapData& data) { data.landmarks.pop_back(); },
           [](VisualMapData& data) { data.landmarks[0][0].sights[0].image = 1; },
           [](VisualMapData& data) { data.landmarks[0][0].sights[1].seen.x() = std::nanf(""); },
           [](VisualMapData& data) { data.landmarks[0][0].sigma.y() = -1; },
           [](VisualMapData& data) { data.landmarks[2][0].heading = 2; },
           [](VisualMapData& data) {
             data.headings_deg = {90, 0, 180};
           }}) {
    MapRows rows = ExampleRows();
    rows.visual_map = MakeExampleVisualMap();
    change(rows.visual_map);
    const Status status = WriteMapRows(rows, MapPath("bad.cairn"));
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(RoundAsStored, RefusesWhatLiesOutsideOfTheLargestImage) {
  for (const float x : {-2049.0F, 6200.0F, std::nanf("")}) {
    VisualMapData data = MakeExampleVisualMap();
    data.landmarks[0][0].sights[0].seen.x() = x;
    EXPECT_EQ(RoundAsStored(&data).error().code, ErrorCode::kUnsupported);
  }
}

TEST(MapFile, VerticesOfAPlanAreNumberedByUse) {
  Views views = MakeExampleViews();
  std::vector<int32_t> mixed = {7, 3, 1, 6, 0, 4};  // and two that nothing names
  Views other = views;
  other.vertices.assign(8, {-5, -5});
  for (size_t i = 0; i < mixed.size(); ++i) other.vertices[mixed[i]] = views.vertices[i];
  for (int32_t& vertex : other.face_vertices) vertex = mixed[vertex];
  other.links[0] = {0, 1, mixed[1], mixed[2]};
  EXPECT_FALSE(IsNumberedByUse(other));
  MapRows rows = ExampleRows();
  ASSERT_TRUE(emit_map::AddViews(other, /*regions=*/true, &rows).ok());
  EXPECT_EQ(rows.views.vertices, views.vertices);
  EXPECT_EQ(rows.views.face_vertices, views.face_vertices);
  EXPECT_EQ(rows.views.links, views.links);
  rows.frame.unit = "arbitrary";
  EXPECT_EQ(emit_map::AddViews(other, /*regions=*/true, &rows).error().code, ErrorCode::kInvalidArgument);
}

TEST(MapFile, FailedWriteLeavesTheOldFile) {
  ASSERT_TRUE(WriteMapRows(ExampleRows(), MapPath("kept.cairn")).ok());
  const std::string before = *ReadFile(MapPath("kept.cairn"));
  MapRows broken = ExampleRows();
  broken.regions[0].landmarks = {0, 99};
  EXPECT_FALSE(WriteMapRows(broken, MapPath("kept.cairn")).ok());
  EXPECT_EQ(*ReadFile(MapPath("kept.cairn")), before);
}

}  // namespace
}  // namespace cairn
