#include <algorithm>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/world/dropped_items.h"
#include "core/world/feature_class.h"
#include "tests/core/world/edited_database.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

// Every number of it is another.
FeatureClass ExampleClass(ClassId class_id) {
  FeatureClass made;
  made.class_id = class_id;
  made.position = {1.5, -2.5, 3.5};
  made.covariance << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  made.reprojection_error_px = 0.75;
  for (int i = 0; i < kSiftDescriptorDim; ++i) made.descriptor[i] = static_cast<uint8_t>(i + class_id);
  made.observations = {
      {.image_id = 10, .keypoint_idx = 7, .keypoint = {.x = 1, .y = 2, .scale = 3, .orientation = 4}},
      {.image_id = 12, .keypoint_idx = 8, .keypoint = {.x = 5, .y = 6, .scale = 7, .orientation = 8}}};
  made.age = {.sessions = {{.expected = 2.5F, .num_seen = 2, .there = 0.9F},
                           {.expected = 3.5F, .num_seen = 1, .there = 0.8F}},
              .presence = 0.7F};
  return made;
}

Classes ExampleClasses() {
  Classes classes;
  classes.cameras = {
      {.camera_id = 1, .width = 640, .height = 480, .params = {500, 320, 240}, .has_focal_prior = true},
      {.camera_id = 2, .width = 320, .height = 200, .params = {250, 160, 100}, .has_focal_prior = false}};
  classes.stated_cameras = {{.camera_id = 2, .width = 321, .height = 201, .params = {251, 161, 101}}};
  classes.images = {{.image_id = 10, .name = "a.jpg", .camera_id = 1},
                    {.image_id = 12, .name = "b.jpg", .camera_id = 2}};
  classes.images[0].cam_from_world = {.rotation = Eigen::Quaterniond(0.5, -0.1, 0.7, 0.5),
                                      .translation = {1, 2, 3}};
  classes.images[0].given_cam_from_world = {.rotation = Eigen::Quaterniond(0.1, 0.5, -0.5, 0.7),
                                            .translation = {4, 5, 6}};
  classes.classes = {ExampleClass(3), ExampleClass(5)};
  classes.classes[1].age.sessions.clear();
  classes.vanished = {ExampleClass(4)};
  classes.sessions = {"spring", "autumn"};
  classes.changes = {{.session = 1,
                      .position = {7, 8, 9},
                      .radius_m = 0.5,
                      .num_vanished = 11,
                      .num_appeared = 13,
                      .image_before = 10,
                      .image_after = 12,
                      .moved_to = 1,
                      .num_moved = 17},
                     {.session = 1, .image_after = 10},
                     {.session = 0, .image_before = 12, .moved_to = 2}};
  classes.camera_from_given = {.rotation = Eigen::Quaterniond(0.7, 0.1, 0.5, -0.5),
                               .translation = {0.1, 0.2, 0.3}};
  classes.stated_pose_sigma_m = 0.25;
  classes.stated_pose_sigma_deg = 1.25;
  classes.keypoint_correlation = 0.125;
  classes.dropped = {{"ambiguous", 19}, {"few_observations", 23}};
  return classes;
}

std::string WrittenClasses(const Classes& classes, const std::vector<DroppedItem>& dropped_items = {}) {
  const std::string path = testing::TempDir() + "/classes_test.db";
  const Status status = WriteClasses(classes, path, dropped_items);
  EXPECT_TRUE(status.ok()) << (status.ok() ? "" : status.error().message);
  return path;
}

void ExpectSameCameras(const std::vector<Camera>& a, const std::vector<Camera>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].camera_id, b[i].camera_id);
    EXPECT_EQ(a[i].model, b[i].model);
    EXPECT_EQ(a[i].width, b[i].width);
    EXPECT_EQ(a[i].height, b[i].height);
    EXPECT_TRUE(std::equal(a[i].params.begin(), a[i].params.end(), b[i].params.begin(), b[i].params.end()));
    EXPECT_EQ(a[i].has_focal_prior, b[i].has_focal_prior);
  }
}

void ExpectSameClasses(const std::vector<FeatureClass>& a, const std::vector<FeatureClass>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].class_id, b[i].class_id);
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_EQ(a[i].covariance, b[i].covariance);
    EXPECT_EQ(a[i].reprojection_error_px, b[i].reprojection_error_px);
    EXPECT_EQ(a[i].descriptor, b[i].descriptor);
    ASSERT_EQ(a[i].observations.size(), b[i].observations.size());
    EXPECT_EQ(std::memcmp(a[i].observations.data(), b[i].observations.data(),
                          a[i].observations.size() * sizeof(Observation)),
              0);
    ASSERT_EQ(a[i].age.sessions.size(), b[i].age.sessions.size());
    for (size_t j = 0; j < a[i].age.sessions.size(); ++j) {
      EXPECT_EQ(a[i].age.sessions[j].expected, b[i].age.sessions[j].expected);
      EXPECT_EQ(a[i].age.sessions[j].num_seen, b[i].age.sessions[j].num_seen);
      EXPECT_EQ(a[i].age.sessions[j].there, b[i].age.sessions[j].there);
    }
    EXPECT_EQ(a[i].age.presence, b[i].age.presence);
  }
}

TEST(Classes, SurviveTheirFile) {
  const Classes classes = ExampleClasses();
  const Result<Classes> read = ReadClasses(WrittenClasses(classes));
  ASSERT_TRUE(read.ok()) << read.error().message;
  ExpectSameCameras(read->cameras, classes.cameras);
  ExpectSameCameras(read->stated_cameras, classes.stated_cameras);
  ASSERT_EQ(read->images.size(), 2);
  for (size_t i = 0; i < 2; ++i) {
    const SurveyImage &a = read->images[i], &b = classes.images[i];
    EXPECT_EQ(a.image_id, b.image_id);
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.camera_id, b.camera_id);
    EXPECT_EQ(a.cam_from_world.Matrix(), b.cam_from_world.Matrix());
    EXPECT_EQ(a.given_cam_from_world.Matrix(), b.given_cam_from_world.Matrix());
  }
  ExpectSameClasses(read->classes, classes.classes);
  ExpectSameClasses(read->vanished, classes.vanished);
  EXPECT_EQ(read->sessions, classes.sessions);
  ASSERT_EQ(read->changes.size(), 3);
  for (size_t i = 0; i < 3; ++i) {
    const PlaceChange &a = read->changes[i], &b = classes.changes[i];
    EXPECT_EQ(a.session, b.session);
    EXPECT_EQ(a.position, b.position);
    EXPECT_EQ(a.radius_m, b.radius_m);
    EXPECT_EQ(a.num_vanished, b.num_vanished);
    EXPECT_EQ(a.num_appeared, b.num_appeared);
    EXPECT_EQ(a.image_before, b.image_before);
    EXPECT_EQ(a.image_after, b.image_after);
    EXPECT_EQ(a.moved_to, b.moved_to);
    EXPECT_EQ(a.num_moved, b.num_moved);
  }
  EXPECT_EQ(read->camera_from_given.Matrix(), classes.camera_from_given.Matrix());
  EXPECT_EQ(read->stated_pose_sigma_m, 0.25);
  EXPECT_EQ(read->stated_pose_sigma_deg, 1.25);
  EXPECT_EQ(read->keypoint_correlation, 0.125);
  EXPECT_THAT(read->dropped, ElementsAre(Pair("ambiguous", 19), Pair("few_observations", 23)));
}

TEST(Classes, CovariancesAreStoredByRowsOfTheUpperTriangle) {
  // As schemas/classes.sql says: xx xy xz yy yz zz.
  const SQLite::Database database(WrittenClasses(ExampleClasses()));
  SQLite::Statement row(database, "SELECT covariance FROM classes WHERE class_id = 3");
  ASSERT_TRUE(row.executeStep());
  const Result<std::vector<double>> values = BlobToVector<double>(row.getColumn(0), "covariance");
  ASSERT_TRUE(values.ok());
  EXPECT_THAT(*values, ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST(Classes, ErrorsNameTheElement) {
  const auto error = [whole = *ReadFile(WrittenClasses(ExampleClasses()))](const std::string& sql) {
    const Result<Classes> read = ReadClasses(EditedDatabase("edited_classes.db", whole, sql));
    EXPECT_FALSE(read.ok()) << sql;
    return read.ok() ? Error{} : read.error();
  };
  const auto message = [&](const std::string& sql) { return error(sql).message; };
  for (const char* table : {"classes", "stated_cameras", "vanished", "changes"})
    EXPECT_EQ(error(std::string("DROP TABLE ") + table).code, ErrorCode::kUnsupported) << table;
  EXPECT_THAT(message("UPDATE classes SET position = x'00' WHERE class_id = 5"),
              HasSubstr("class 5: blob of 1 bytes, expected 24"));
  EXPECT_THAT(message("UPDATE classes SET covariance = position WHERE class_id = 5"),
              HasSubstr("class 5: blob of 24 bytes, expected 48"));
  EXPECT_THAT(message("UPDATE classes SET descriptor = position WHERE class_id = 5"),
              HasSubstr("class 5: descriptor of 24 bytes, expected 128"));
  EXPECT_THAT(message("UPDATE classes SET observations = x'00' WHERE class_id = 3"),
              HasSubstr("class 3: a blob of 1"));
  EXPECT_THAT(message("UPDATE classes SET sightings = x'00' WHERE class_id = 3"),
              HasSubstr("class 3: a blob of 1"));
  EXPECT_THAT(message("DELETE FROM images WHERE image_id = 12"),
              HasSubstr("class 3: observed in image 12, which the file does not list"));
  EXPECT_THAT(message("INSERT INTO sessions VALUES (2, 'winter')"),
              HasSubstr("class 3: sightings of 2 sessions, expected 3"));
  EXPECT_THAT(message("UPDATE images SET refined = x'00' WHERE image_id = 12"),
              HasSubstr("b.jpg: blob of 1 bytes, expected 56"));
  EXPECT_THAT(message("UPDATE images SET given = x'00' WHERE image_id = 12"),
              HasSubstr("b.jpg: blob of 1 bytes, expected 56"));
  EXPECT_THAT(message("UPDATE alignment SET camera_from_given = x'00'"),
              HasSubstr("alignment: blob of 1 bytes, expected 56"));
  EXPECT_THAT(message("UPDATE changes SET position = x'00' WHERE rowid = 2"),
              HasSubstr("change 1: blob of 1 bytes, expected 24"));
  for (const auto& [session, words] :
       {std::pair("2", "change 1: of session 2 of 2"), std::pair("-1", "change 1: of session -1 of 2")})
    EXPECT_THAT(message(std::string("UPDATE changes SET session_idx = ") + session + " WHERE rowid = 2"),
                HasSubstr(words));
  EXPECT_THAT(message("UPDATE changes SET image_before = 11 WHERE rowid = 1"),
              HasSubstr("shown by images 11 and 12"));
  EXPECT_THAT(message("UPDATE changes SET image_after = 11 WHERE rowid = 1"),
              HasSubstr("shown by images 10 and 11"));
  EXPECT_THAT(message("UPDATE changes SET moved_to = 3 WHERE rowid = 1"),
              HasSubstr("change 0 moved to change 3 of 3"));
  EXPECT_THAT(message("UPDATE changes SET moved_to = -2 WHERE rowid = 1"),
              HasSubstr("change 0 moved to change -2 of 3"));
  // Things move within a session.
  EXPECT_THAT(message("UPDATE changes SET moved_to = 0 WHERE rowid = 3"),
              HasSubstr("change 2 moved to change 0 of 3"));
  EXPECT_THAT(message("UPDATE cameras SET params = x'00' WHERE camera_id = 2"),
              HasSubstr("cameras: a blob of 1"));
  EXPECT_FALSE(message("UPDATE cameras SET model = 99 WHERE camera_id = 2").empty());
  EXPECT_FALSE(message("UPDATE cameras SET width = 0 WHERE camera_id = 2").empty());
}

TEST(Classes, WithoutAnAlignmentNothingWasRefined) {
  const std::string whole = *ReadFile(WrittenClasses(ExampleClasses()));
  const Result<Classes> read =
      ReadClasses(EditedDatabase("edited_classes.db", whole, "DELETE FROM alignment"));
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->camera_from_given.Matrix(), Pose().Matrix());
  EXPECT_EQ(read->stated_pose_sigma_m, 0);
}

TEST(DroppedItems, SurviveTheirTable) {
  const std::vector<DroppedItem> items = {
      {.reason = DropReason::kNoPose, .item_id = 10},
      {.reason = DropReason::kOutlier, .item_id = 3, .found = 0, .seen_at = {10, 7, 12, 8}},
      {.reason = DropReason::kAmbiguous, .item_id = int64_t{1} << 40, .found = -2, .seen_at = {10, 7}},
      {.reason = DropReason::kUnreadable, .item_id = 0}};
  const Result<std::vector<DroppedItem>> read =
      ReadDroppedItems(WrittenClasses(ExampleClasses(), items), kDroppedItemsTable);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, items);
  const Result<std::vector<DroppedItem>> none =
      ReadDroppedItems(WrittenClasses(ExampleClasses(), items), "another");
  ASSERT_TRUE(none.ok());
  EXPECT_THAT(*none, IsEmpty());
}

TEST(DroppedItems, ErrorsNameTheRow) {
  const std::string whole =
      *ReadFile(WrittenClasses(ExampleClasses(), {{.reason = DropReason::kNoPose, .item_id = 1}}));
  const auto message = [&](const std::string& values) {
    const std::string path =
        EditedDatabase("edited_classes.db", whole, "INSERT INTO dropped_items VALUES (" + values + ")");
    const Result<std::vector<DroppedItem>> read = ReadDroppedItems(path, kDroppedItemsTable);
    return read.ok() ? "" : read.error().message;
  };
  EXPECT_THAT(message("19, 1, NULL, NULL"), HasSubstr("table dropped_items, row 2: unknown reason 19"));
  // 28 in its low bits.
  EXPECT_THAT(message("4294967324, 1, NULL, NULL"), HasSubstr("unknown reason 4294967324"));
  EXPECT_THAT(message("-1, 1, NULL, NULL"), HasSubstr("unknown reason -1"));
  EXPECT_THAT(message("20, -1, NULL, NULL"), HasSubstr("row 2: item -1"));
  EXPECT_THAT(message("20, 0, NULL, x'010203'"), HasSubstr("row 2: a blob of 3 bytes"));
  // Keypoints are pairs of numbers; stations are numbers.
  const std::string one = "x'01000000'", two = "x'0100000002000000'";
  for (const char* reason : {"24", "27"}) {
    EXPECT_THAT(message(std::string(reason) + ", 1, NULL, " + one), HasSubstr("a keypoint without its index"))
        << reason;
    EXPECT_EQ(message(std::string(reason) + ", 1, NULL, " + two), "") << reason;
  }
  for (const char* reason : {"30", "35", "20"})
    EXPECT_EQ(message(std::string(reason) + ", 1, NULL, " + one), "") << reason;
}

TEST(DropReasons, AreFoundByTheirNumbers) {
  for (const DropReasonEntry& entry : AllDropReasons()) {
    EXPECT_EQ(FindDropReason(static_cast<int>(entry.reason)), &entry);
    EXPECT_EQ(&DescribeDropReason(entry.reason), &entry);
  }
  EXPECT_EQ(FindDropReason(0), nullptr);
}

}  // namespace
}  // namespace cairn
