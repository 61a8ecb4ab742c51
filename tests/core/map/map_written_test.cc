// Tables and pages in the file of a map: rows of its head, how many rows its findings have, blocks of a kind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/map/map_file.h"
#include "core/map/map_findings_tables.h"
#include "core/map/map_tables.h"
#include "tests/core/map/full_rows.h"

namespace cairn {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;

std::string WrittenPath() { return testing::TempDir() + "/written.cairn"; }

// The first column of a query on the file that the rows make.
std::vector<std::string> Queried(const MapRows& rows, const std::string& query) {
  const Status status = WriteMapRows(rows, WrittenPath());
  EXPECT_TRUE(status.ok()) << status.error().message;
  SQLite::Database database(WrittenPath());
  SQLite::Statement statement(database, query);
  std::vector<std::string> values;
  while (statement.executeStep()) values.push_back(statement.getColumn(0).getString());
  return values;
}

constexpr const char* kKeys = "SELECT key FROM meta";

// What was not measured has no row, so that programs which do not know it read the map all the same; the
// least that can be measured, 1 of a scale, and the most, 1 of a correlation, have one.
TEST(MapWritten, MeasuredFiguresHaveRowsAndOthersNone) {
  MapRows rows = FullRows();
  rows.epoch = 0;
  rows.covariance_scale = rows.keypoint_correlation = 0;
  for (const char* key : {"epoch", "covariance_scale", "keypoint_correlation"})
    EXPECT_THAT(Queried(rows, kKeys), Not(Contains(key)));
  rows.epoch = 1;
  rows.covariance_scale = rows.keypoint_correlation = 1;
  EXPECT_THAT(Queried(rows, kKeys), IsSupersetOf({"epoch", "covariance_scale", "keypoint_correlation"}));
  const Result<MapRows> read = ReadMapRows(WrittenPath());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->epoch, 1u);
  EXPECT_EQ(read->covariance_scale, 1);
  EXPECT_EQ(read->keypoint_correlation, 1);
}

// has_focal_prior is 0 for a guess and 1 otherwise.
TEST(MapWritten, CamerasSayWhetherTheirFocalLengthWasGuessed) {
  MapRows rows = FullRows();
  ASSERT_EQ(rows.cameras.size(), 2u);
  rows.cameras[0].has_focal_prior = false;
  rows.cameras[1].has_focal_prior = true;
  EXPECT_THAT(Queried(rows, "SELECT has_focal_prior FROM cameras ORDER BY camera_id"), ElementsAre("0", "1"));
  const Result<MapRows> read = ReadMapRows(WrittenPath());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_FALSE(read->cameras[0].has_focal_prior);
  EXPECT_TRUE(read->cameras[1].has_focal_prior);
}

TEST(MapWritten, MapsOfTwentyThousandLandmarksHaveLargePages) {
  MapRows rows = FullRows();
  rows.visual_map = {};
  const auto page_size = [&](size_t num_landmarks) {
    const auto num = static_cast<Eigen::Index>(num_landmarks);
    rows.landmarks.resize(num_landmarks, rows.landmarks[0]);
    rows.descriptors = DescriptorMatrix::Zero(num, kSiftDescriptorDim);
    return Queried(rows, "PRAGMA page_size");
  };
  EXPECT_THAT(page_size(19'999), ElementsAre("512"));
  EXPECT_THAT(page_size(20'000), ElementsAre("4096"));
  const Result<MapRows> read = ReadMapRows(WrittenPath());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->landmarks.size(), 20'000u);
}

// More nodes than a block has, each with an image of its own.
TEST(MapWritten, NodesOfSeveralBlocksKeepTheirEntropy) {
  MapRows rows = FullRows();
  const MapImage image = rows.images.back();
  while (rows.images.size() < 1030) {
    rows.images.push_back(image);
    rows.images.back().image_id = image.image_id + static_cast<ImageId>(rows.images.size());
  }
  rows.vocabulary = {};
  rows.documents = "all";
  rows.appearance.clear();
  for (int32_t node = 0; node < 1030; ++node) {
    rows.appearance.push_back({.images = {node}, .is_kept = true, .entropy = node / 1000.0});
    if (node % 2 == 0) rows.appearance.back().look_alikes = {{node + 1, 0.25}};
  }
  ASSERT_TRUE(WriteMapRows(rows, WrittenPath()).ok());
  const Result<MapFile> file = MapFile::Open(WrittenPath(), {});
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->directory().NumBlocks(BlockKind::kAmbiguity), 2);
  const Result<MapRows> read = ReadMapRows(*file);
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->appearance, rows.appearance);
}

// Databases with these tables, each of so many columns and rows, read as the findings of a map.
std::string FindingsRefusal(const std::string& table, int num_columns, int num_rows) {
  SQLite::Database database(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  std::string columns = "c0 INTEGER PRIMARY KEY";
  for (int i = 1; i < num_columns; ++i) columns += fmt::format(", c{}", i);
  database.exec(fmt::format("CREATE TABLE {} ({})", table, columns));
  for (int row = 0; row < num_rows; ++row)
    database.exec(fmt::format("INSERT INTO {} (c0) VALUES ({})", table, row));
  const Result<StoredRows> rows = ReadFindingsRows(database, "map.cairn", 1000);
  if (!rows.ok()) return rows.error().message;
  EXPECT_EQ(rows->at(table).size(), static_cast<size_t>(num_rows));
  return "";
}

TEST(MapWritten, FindingsHaveTheColumnsOfTheirSchemas) {
  for (const auto& [table, num_columns] :
       {std::pair("changes", 10), std::pair("drop_reasons", 7), std::pair("moves", 3),
        std::pair("promises", 14), std::pair("region_entropies", 2), std::pair("self_test_regions", 8)}) {
    EXPECT_EQ(FindingsRefusal(table, num_columns, 1), "");
    EXPECT_EQ(FindingsRefusal(table, num_columns + 1, 1), "");  // of a later minor version
    EXPECT_THAT(
        FindingsRefusal(table, num_columns - 1, 1),
        HasSubstr(fmt::format("table {} has {} columns, expected {}", table, num_columns - 1, num_columns)));
  }
}

TEST(MapWritten, FindingsHaveOnePromiseAndAtMost4096Reasons) {
  EXPECT_EQ(FindingsRefusal("promises", 14, 1), "");
  EXPECT_THAT(FindingsRefusal("promises", 14, 2), HasSubstr("table promises has more than 1 rows"));
  EXPECT_EQ(FindingsRefusal("drop_reasons", 7, 4096), "");
  EXPECT_THAT(FindingsRefusal("drop_reasons", 7, 4097),
              HasSubstr("table drop_reasons has more than 4096 rows"));
}

// A path that leads through a file.
TEST(MapWritten, NothingIsFoundBelowAFile) {
  ASSERT_TRUE(WriteMapRows(FullRows(), WrittenPath()).ok());
  EXPECT_EQ(MapFile::Open(WrittenPath() + "/map.cairn", {}).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace cairn
