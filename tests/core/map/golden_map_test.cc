#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/features/transform_code.h"
#include "core/files/database.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/map/example.h"
#include "tests/core/map/full_rows.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string GoldenPath(const std::string& name) { return testing::TempDir() + "/golden_" + name; }

// Version 1.0 as the program of that version wrote the example.
TEST(GoldenMap, Version1IsMigrated) {
  const std::string path = GOLDEN_DIR "/map_1.0.cairn";
  EXPECT_EQ(ReadMapRows(path).error().code, ErrorCode::kTooOld);
  EXPECT_THAT(ReadMapRows(path).error().message, HasSubstr("cairn migrate"));
  const Result<MapRows> old = ReadMapRowsVersion1(path);
  ASSERT_TRUE(old.ok()) << old.error().message;
  ASSERT_TRUE(WriteMapRows(*old, GoldenPath("migrated.cairn")).ok());
  const Result<MapRows> migrated = ReadMapRows(GoldenPath("migrated.cairn"));
  ASSERT_TRUE(migrated.ok()) << migrated.error().message;
  EXPECT_EQ(migrated->name, "example");
  EXPECT_EQ(migrated->writer, "cairn test");
  EXPECT_EQ(migrated->lower_bound, 2);
  EXPECT_EQ(migrated->self_test.at("num_localized"), 3);
  EXPECT_EQ(migrated->stage_options, old->stage_options);
  EXPECT_THAT(migrated->images[1].landmarks, ElementsAre(0, 1, 2));
  EXPECT_EQ(migrated->images[1].name, "image2.png");
  EXPECT_NEAR(migrated->landmarks[0].position.x(), 2.1234, 1e-12);
  EXPECT_EQ(migrated->descriptors, old->descriptors);
  EXPECT_EQ(migrated->vocabulary.inverted_files, old->vocabulary.inverted_files);
  EXPECT_EQ(ReadMapRowsVersion1(GoldenPath("migrated.cairn")).error().code, ErrorCode::kTooNew);
}

// Version 2.0 as the program of that version wrote the example.
TEST(GoldenMap, Version2IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.0.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->name, "example");
  EXPECT_THAT(rows->images[1].landmarks, ElementsAre(0, 1, 2));
  EXPECT_THAT(rows->regions[1].landmarks, ElementsAre(0, 2));
  EXPECT_THAT(rows->regions[1].stations, ElementsAre(0, 1));
  EXPECT_NEAR(rows->landmarks[0].position.x(), 2.1234, 1e-12);
  EXPECT_EQ(rows->descriptors(1, 0), 30);
  EXPECT_EQ(rows->vocabulary.num_words(), 1);
}

// Version 2.2 as the program of that version wrote a sparse example.
TEST(GoldenMap, Version2_2IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.2.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->documents, "kept");
  ASSERT_EQ(rows->appearance.size(), 3u);
  EXPECT_EQ(rows->appearance[1], (MapAppearanceNode{{1}, true, {{2, 30}}}));
  EXPECT_THAT(rows->vocabulary.document_ids, ElementsAre(2));
  EXPECT_THAT(rows->images[1].landmarks, ElementsAre(0, 1, 2));
}

// An example with everything that came with 2.3: ambiguity, a floor plan and its regions.
MapRows Rows2_3() {
  const EmitExample example = MakeEmitExample();
  MapRows rows = *emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                    {.landmarks = "regions", .words = "survey"}, &example.appearance);
  rows.name = "example";
  rows.writer = "cairn test";
  EXPECT_TRUE(emit_map::AddViews(MakeExampleViews(), /*regions=*/true, &rows).ok());
  return rows;
}

// Version 2.3 as the program of that version wrote it.
TEST(GoldenMap, Version2_3IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.3.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows->appearance.size(), 3u);  // image 3 is not in the map
  EXPECT_EQ(rows->appearance[1], (MapAppearanceNode{{1}, true, {{2, 30}}, 0.5, {}}));
  EXPECT_EQ(rows->appearance[0].look_alikes, (std::vector<MapAppearanceNode::LookAlike>{{2, 0.5}}));
  EXPECT_EQ(rows->findings.region_entropies, Rows2_3().findings.region_entropies);
  const Views views = MakeExampleViews();
  EXPECT_EQ(rows->views.plan.vertices, views.plan.vertices);
  EXPECT_EQ(rows->views.vertices, views.vertices);
  EXPECT_EQ(rows->views.face_vertices, views.face_vertices);
  EXPECT_EQ(rows->views.parents, views.parents);
  EXPECT_EQ(rows->views.toggled_labels, views.toggled_labels);
  EXPECT_EQ(rows->views.links, views.links);
  EXPECT_EQ(rows->vocabulary.inverted_files, Rows2_3().vocabulary.inverted_files);
}

// Version 2.4 as the program of that version wrote it: findings that no hash but the file's covers.
TEST(GoldenMap, Version2_4IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.4.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->epoch, 0u);
  EXPECT_EQ(rows->findings_hash, "");
  EXPECT_EQ(rows->findings.drops.size(), 1u);
  EXPECT_EQ(rows->findings.self_test_regions.size(), 2u);
  const VisualMapData visual_map = MakeExampleVisualMap();
  EXPECT_EQ(rows->visual_map.focal_px, visual_map.focal_px);
  EXPECT_EQ(rows->visual_map.landmarks[2][1].sights, visual_map.landmarks[2][1].sights);
  // A changed finding is seen all the same.
  std::filesystem::copy_file(GOLDEN_DIR "/map_2.4.cairn", GoldenPath("changed_2.4.cairn"),
                             std::filesystem::copy_options::overwrite_existing);
  SQLite::Database(GoldenPath("changed_2.4.cairn"), SQLite::OPEN_READWRITE)
      .exec("UPDATE drop_reasons SET num_dropped = 199");
  EXPECT_EQ(ReadMapRows(GoldenPath("changed_2.4.cairn")).error().code, ErrorCode::kCorrupt);
}

// Version 2.5 as the program of that version wrote and signed it, of epoch 3.
TEST(GoldenMap, Version2_5IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.5.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->epoch, 3u);
  EXPECT_EQ(rows->findings_hash.size(), 64u);
  EXPECT_EQ(rows->findings, ReadMapRows(GOLDEN_DIR "/map_2.4.cairn")->findings);
  EXPECT_EQ(rows->descriptors, ReadMapRows(GOLDEN_DIR "/map_2.4.cairn")->descriptors);
}

// Version 2.6: that of 2.5 with its descriptors by the levels of a transform, packed, and a promise.
TEST(GoldenMap, Version2_6IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.6.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  MapRows before = *ReadMapRows(GOLDEN_DIR "/map_2.5.cairn");
  const TransformCode code = QuantizeByTransform(16, &before.descriptors);
  ASSERT_TRUE(rows->descriptor_code);
  EXPECT_EQ(*rows->descriptor_code, code);
  EXPECT_EQ(rows->descriptors, before.descriptors);
  ASSERT_EQ(rows->landmarks.size(), before.landmarks.size());
  for (size_t i = 0; i < before.landmarks.size(); ++i) {
    EXPECT_LT((rows->landmarks[i].position - before.landmarks[i].position).norm(), 0.0021) << i;
    EXPECT_EQ(rows->landmarks[i].num_observations, before.landmarks[i].num_observations);
  }
  for (size_t i = 0; i < before.images.size(); ++i)
    EXPECT_EQ(rows->images[i].landmarks, before.images[i].landmarks) << i;
  ASSERT_TRUE(rows->findings.promise);
  EXPECT_EQ(*rows->findings.promise, FullRows().findings.promise);
}

// Version 2.7: that of 2.6 with a camera that differs from what is stated, and keypoints that err together.
TEST(GoldenMap, Version2_7IsRead) {
  const Result<MapRows> rows = ReadMapRows(GOLDEN_DIR "/map_2.7.cairn");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->keypoint_correlation, 0.0625);
  ASSERT_EQ(rows->stated_cameras.size(), 1u);
  EXPECT_EQ(rows->stated_cameras[0].camera_id, rows->cameras[0].camera_id);
  EXPECT_EQ(rows->stated_cameras[0].model, CameraModel::kPinhole);
  EXPECT_THAT(rows->stated_cameras[0].params, ElementsAre(101.5, 102.25, 99, 51));
  const Result<MapRows> before = ReadMapRows(GOLDEN_DIR "/map_2.6.cairn");
  EXPECT_EQ(rows->descriptors, before->descriptors);
  EXPECT_TRUE(before->stated_cameras.empty());
  EXPECT_EQ(before->keypoint_correlation, 0);
}

}  // namespace
}  // namespace cairn
