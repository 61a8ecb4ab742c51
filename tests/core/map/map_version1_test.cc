// Maps of format 1: their tables, as schemas/0001_map.sql names the columns, and what of them is refused.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/blob.h"
#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/files/file.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The example of version 1.0, after statements that change it.
Result<MapRows> ReadChanged(const std::string& statements) {
  const std::string path = testing::TempDir() + "/version1.cairn";
  EXPECT_TRUE(WriteFileAtomically(path, *ReadFile(GOLDEN_DIR "/map_1.0.cairn")).ok());
  SQLite::Database(path, SQLite::OPEN_READWRITE).exec(statements);
  return ReadMapRowsVersion1(path);
}

// The message of its refusal; "" where it is read.
std::string RefusalOf(const std::string& statements) {
  const Result<MapRows> rows = ReadChanged(statements);
  if (rows.ok()) return "";
  EXPECT_EQ(rows.error().code, ErrorCode::kCorrupt);
  return rows.error().message;
}

// Bytes as SQL writes them.
std::string Sql(BlobWriter writer) {
  std::string text = "x'";
  for (const char byte : writer.Take()) text += fmt::format("{:02x}", static_cast<uint8_t>(byte));
  return text + "'";
}

std::string Floats(const std::vector<float>& values) {
  BlobWriter writer;
  for (const float value : values) writer.Float32(value);
  return Sql(std::move(writer));
}

TEST(MapVersion1, ImagesAreReadByTheirColumns) {
  const Result<MapRows> rows = ReadChanged(
      "UPDATE images SET qw = 0.1, qx = -0.3, qy = 0.3, qz = 0.9, tx = 1.5, ty = -2.5, tz = 3.25 "
      "WHERE image_id = 2; UPDATE images SET station_idx = NULL WHERE image_id = 4");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows->images.size(), 3u);
  EXPECT_EQ(rows->images[1].image_id, 2u);
  EXPECT_EQ(rows->images[1].name, "image2.png");
  EXPECT_EQ(rows->images[1].camera_id, 3u);
  EXPECT_EQ(rows->images[1].station, 1);
  EXPECT_EQ(rows->images[1].cam_from_world.rotation.coeffs(), Eigen::Vector4d(-0.3, 0.3, 0.9, 0.1));
  EXPECT_EQ(rows->images[1].cam_from_world.translation, Eigen::Vector3d(1.5, -2.5, 3.25));
  EXPECT_EQ(rows->images[0].cam_from_world.translation, Eigen::Vector3d(-1, 0, 0));
  EXPECT_EQ(rows->images[2].station, -1);
  EXPECT_THAT(rows->images[2].landmarks, ElementsAre(0, 1));
}

TEST(MapVersion1, ImagesThatMakeNoSenseAreRefused) {
  const auto refusal = [](const std::string& change) {
    return RefusalOf("UPDATE images SET " + change + " WHERE image_id = 4");
  };
  // The words know the image, too.
  const auto renumbered = [](const char* image_id, const char* to) {
    return RefusalOf(
        fmt::format("UPDATE images SET image_id = {1} WHERE image_id = {0}; UPDATE "
                    "vocabulary_documents SET image_id = {1} WHERE image_id = {0}",
                    image_id, to));
  };
  EXPECT_EQ(renumbered("4", "4294967294"), "");
  EXPECT_THAT(refusal("image_id = 4294967295"), HasSubstr("image 4294967295: camera 3 or station 2"));
  EXPECT_EQ(renumbered("1", "0"), "");
  EXPECT_THAT(refusal("image_id = -1"), HasSubstr("image -1: camera 3 or station 2 out of range"));
  EXPECT_THAT(refusal("camera_id = -1"), HasSubstr("image 4: camera -1 or station 2 out of range"));
  EXPECT_THAT(refusal("camera_id = 4294967299"), HasSubstr("camera 4294967299 or station 2 out of range"));
  EXPECT_THAT(refusal("camera_id = 4294967295"), HasSubstr("camera 4294967295, which the map lacks"));
  EXPECT_THAT(refusal("camera_id = 0"), HasSubstr("camera 0, which the map lacks"));
  EXPECT_EQ(refusal("station_idx = -1"), "");
  EXPECT_THAT(refusal("station_idx = -2"), HasSubstr("camera 3 or station -2 out of range"));
  EXPECT_THAT(refusal("station_idx = 2147483648"), HasSubstr("station 2147483648 out of range"));
  EXPECT_THAT(refusal("station_idx = 2147483647"), HasSubstr("station 2147483647 of 3"));
  EXPECT_EQ(refusal("landmarks = x'0201'"), "");  // 1 and 2
  EXPECT_THAT(refusal("landmarks = x'0202'"), HasSubstr("landmarks of image 4"));
  EXPECT_THAT(refusal("num_landmarks = 1"), HasSubstr("landmarks of image 4"));
}

TEST(MapVersion1, StationsAndRegionsAreReadByTheirColumns) {
  const Result<MapRows> rows = ReadChanged(
      "UPDATE stations SET x = 7.5, y = -8.5, heading_deg = NULL WHERE station_idx = 1;"
      "UPDATE stations SET num_neighbours = 2, neighbours = x'0201' WHERE station_idx = 0");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows->stations.size(), 3u);
  EXPECT_EQ(rows->stations[1].position, Eigen::Vector2d(7.5, -8.5));
  EXPECT_FALSE(rows->stations[1].heading_deg.has_value());
  EXPECT_EQ(rows->stations[0].heading_deg, 90);
  EXPECT_TRUE(rows->stations[1].is_covered);
  EXPECT_FALSE(rows->stations[2].is_covered);
  EXPECT_THAT(rows->station_edges, ElementsAre(std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)));
  ASSERT_EQ(rows->regions.size(), 2u);
  EXPECT_THAT(rows->regions[0].stations, ElementsAre(1, 2));
  EXPECT_THAT(rows->regions[0].landmarks, ElementsAre(0, 1));
  EXPECT_THAT(rows->regions[1].stations, ElementsAre(0, 1));
  EXPECT_THAT(rows->regions[1].landmarks, ElementsAre(0, 2));
}

TEST(MapVersion1, StationsAndRegionsThatMakeNoSenseAreRefused) {
  EXPECT_THAT(RefusalOf("UPDATE stations SET station_idx = 3 WHERE station_idx = 2"),
              HasSubstr("station 3 where 2 was expected"));
  EXPECT_THAT(RefusalOf("UPDATE stations SET station_idx = -1 WHERE station_idx = 0"),
              HasSubstr("station -1 where 0 was expected"));
  EXPECT_THAT(RefusalOf("UPDATE stations SET neighbours = x'04' WHERE station_idx = 1"),
              HasSubstr("neighbours of station 1"));
  EXPECT_THAT(RefusalOf("UPDATE regions SET region_idx = 2 WHERE region_idx = 1"),
              HasSubstr("region 2 where 1 was expected"));
  EXPECT_EQ(RefusalOf("UPDATE regions SET stations = x'0102' WHERE region_idx = 1"), "");  // 0 and 2
  EXPECT_THAT(RefusalOf("UPDATE regions SET stations = x'0103' WHERE region_idx = 1"),
              HasSubstr("stations of region 1"));
  EXPECT_THAT(RefusalOf("UPDATE regions SET landmarks = x'0103' WHERE region_idx = 1"),
              HasSubstr("landmarks of region 1"));
}

TEST(MapVersion1, LandmarksAreReadByTheirColumns) {
  const Result<MapRows> rows = ReadChanged(
      "UPDATE landmarks SET class_id = 4294967295, x = 15000, y = -25000, z = 35000, scale = 450, "
      "num_observations = 2147483647, covariance = " +
      Floats({4, 0.5, 0.25, 5, 0.125, 6}) + " WHERE landmark_idx = 1");
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows->landmarks.size(), 3u);
  const MapLandmark& landmark = rows->landmarks[1];
  EXPECT_EQ(landmark.class_id, 4294967295u);
  EXPECT_TRUE(landmark.position.isApprox(Eigen::Vector3d(1.5, -2.5, 3.5), 1e-12));
  EXPECT_NEAR(landmark.scale_m, 0.045, 1e-12);
  EXPECT_EQ(landmark.num_observations, 2147483647);
  EXPECT_EQ(landmark.covariance, (Eigen::Matrix3d() << 4, 0.5, 0.25,  //
                                  0.5, 5, 0.125,                      //
                                  0.25, 0.125, 6)
                                     .finished());
  EXPECT_EQ(rows->landmarks[2].class_id, 10u);
  for (const auto& [row, value] : {std::pair(0, 20), std::pair(1, 30), std::pair(2, 0)})
    EXPECT_TRUE((rows->descriptors.row(row).array() == value).all()) << row;
}

TEST(MapVersion1, LandmarksThatMakeNoSenseAreRefused) {
  const auto refusal = [](const std::string& change) {
    return RefusalOf("UPDATE landmarks SET " + change + " WHERE landmark_idx = 2");
  };
  EXPECT_THAT(refusal("landmark_idx = 3"), HasSubstr("landmark 3 where 2 was expected"));
  EXPECT_THAT(refusal("landmark_idx = -1"), HasSubstr("landmark -1 where 0 was expected"));
  for (const auto& [num_floats, num_bytes] : {std::pair(5, 20), std::pair(7, 28)})
    EXPECT_THAT(
        refusal("covariance = " + Floats(std::vector<float>(num_floats, 1))),
        HasSubstr(fmt::format("landmark 2: a covariance of {} and a descriptor of 128 bytes", num_bytes)));
  for (const int num_bytes : {127, 129})
    EXPECT_THAT(refusal(fmt::format("descriptor = zeroblob({})", num_bytes)),
                HasSubstr(fmt::format("a covariance of 24 and a descriptor of {} bytes", num_bytes)));
  // Rows of few bytes, for which descriptors of 128 would be allocated.
  EXPECT_THAT(
      RefusalOf("WITH RECURSIVE c (i) AS (SELECT 3 UNION ALL SELECT i + 1 FROM c WHERE i < 50000) INSERT "
                "INTO landmarks (landmark_idx, class_id, x, y, z, scale, num_observations, covariance, "
                "descriptor) SELECT i, i, 0, 0, 0, 0, 2, x'', x'' FROM c"),
      HasSubstr("50001 landmarks, more than a map of"));
  // A number that another one would be read for.
  EXPECT_EQ(refusal("class_id = 0, num_observations = 0"), "");
  for (const char* class_id : {"-1", "4294967296"})
    EXPECT_THAT(refusal(std::string("class_id = ") + class_id),
                HasSubstr(fmt::format("landmark 2: class {} or its 2 observations", class_id)));
  for (const char* num : {"-1", "2147483648"})
    EXPECT_THAT(refusal(std::string("num_observations = ") + num),
                HasSubstr(fmt::format("landmark 2: class 10 or its {} observations", num)));
}

}  // namespace
}  // namespace cairn
