#include "core/colmap/cut_database.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/colmap/cameras_text.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::SizeIs;

// A database of images with many keypoints each, so that it has many pages.
class CutDatabase : public testing::Test {
 protected:
  CutDatabase() : path_(testing::TempDir() + "/cut_database.db") {
    std::remove(path_.c_str());
    std::remove((path_ + "-wal").c_str());
    SQLite::Database database(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec(kColmapSchema);
    WriteDatabaseCamera(database, *ParseCamera("PINHOLE,640,480,500,500,320,240"));
    for (ImageId image_id = 1; image_id <= 6; ++image_id) {
      WriteDatabaseImage(database, {image_id, std::to_string(image_id) + ".jpg", 1});
      Features features{.keypoints = PooledVector<Keypoint>(400, Keypoint{1, 2, 3, 0}), .descriptors = {}};
      features.descriptors = DescriptorMatrix::Constant(400, kSiftDescriptorDim, 1);
      WriteDatabaseFeatures(database, image_id, features);
    }
  }

  void Exec(const std::string& sql) { SQLite::Database(path_, SQLite::OPEN_READWRITE).exec(sql); }

  std::vector<DatabaseImage> Images() {
    Result<SQLite::Database> database = OpenCutDatabase(path_);
    EXPECT_TRUE(database.ok()) << database.error().message;
    return database.ok() ? ReadCutDatabaseImages(*database) : std::vector<DatabaseImage>();
  }

  std::string path_;
};

TEST_F(CutDatabase, IsShorterThanItsHeadSays) {
  const uint64_t num_bytes = fs::file_size(path_);
  DatabasePart part = PartOfDatabase(path_);
  EXPECT_EQ(part.num_bytes, num_bytes);
  EXPECT_EQ(part.num_bytes_whole, num_bytes);
  EXPECT_FALSE(part.is_cut());
  fs::resize_file(path_, num_bytes - 1);
  part = PartOfDatabase(path_);
  EXPECT_TRUE(part.is_cut());
  EXPECT_EQ(part.num_bytes_whole, num_bytes);
  EXPECT_EQ(CutText("x.db", part),
            fmt::format("x.db: truncated: {} of {} bytes are there", num_bytes - 1, num_bytes));
  // The rest may be in a log.
  std::ofstream(path_ + "-wal") << "x";
  EXPECT_FALSE(PartOfDatabase(path_).is_cut());
  std::ofstream(path_ + "-wal", std::ios::trunc);
  EXPECT_TRUE(PartOfDatabase(path_).is_cut());
}

TEST_F(CutDatabase, WhatIsNoDatabaseIsNotCut) {
  std::ofstream(path_, std::ios::trunc) << std::string(200, 'x');
  EXPECT_EQ(PartOfDatabase(path_).num_bytes, 0U);
  EXPECT_EQ(PartOfDatabase(path_).num_bytes_whole, 0U);
  fs::remove(path_);
  EXPECT_EQ(PartOfDatabase(path_).num_bytes, 0U);
  EXPECT_FALSE(PartOfDatabase(path_).is_cut());
}

TEST_F(CutDatabase, HasTheImagesWhosePagesAreThere) {
  fs::resize_file(path_, fs::file_size(path_) - 4096);
  const std::vector<DatabaseImage> images = Images();
  ASSERT_THAT(images, SizeIs(6));
  EXPECT_EQ(images[2].image_id, 3U);
  EXPECT_EQ(images[2].name, "3.jpg");
  EXPECT_EQ(images[2].camera_id, 1U);
}

TEST_F(CutDatabase, EndsAtTheFirstRowThatIsNone) {
  Exec("UPDATE images SET name = x'00' WHERE image_id = 4");
  EXPECT_THAT(Images(), SizeIs(3));
  Exec("UPDATE images SET name = '4.jpg' WHERE image_id = 4");
  EXPECT_THAT(Images(), SizeIs(6));
  Exec("PRAGMA foreign_keys = 0; UPDATE images SET camera_id = 'x' WHERE image_id = 2");
  EXPECT_THAT(Images(), SizeIs(1));
}

TEST_F(CutDatabase, NeedsAllTablesOfFeatures) {
  for (const std::string table : {"descriptors", "keypoints", "images", "cameras"}) {
    Exec("PRAGMA foreign_keys = 0; DROP TABLE " + table);
    const Result<SQLite::Database> database = OpenCutDatabase(path_);
    ASSERT_FALSE(database.ok()) << table;
    EXPECT_EQ(database.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(database.error().message, HasSubstr("it has no table " + table));
  }
}

}  // namespace
}  // namespace cairn
