// What stands in the file of a map that is written: rows of its head, and pages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/files/database.h"
#include "core/map/map_file.h"
#include "tests/core/map/full_rows.h"

namespace cairn {
namespace {

using testing::Contains;
using testing::ElementsAre;
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

// A path that leads through a file.
TEST(MapWritten, NothingIsFoundBelowAFile) {
  ASSERT_TRUE(WriteMapRows(FullRows(), WrittenPath()).ok());
  EXPECT_EQ(MapFile::Open(WrittenPath() + "/map.cairn", {}).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace cairn
