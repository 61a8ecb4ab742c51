#include "core/colmap/colmap_database.h"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The tables that every version has, as COLMAP 3.10 and later make images: without prior_*.
constexpr char kTables[] = R"sql(
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL,
  camera_id INTEGER NOT NULL);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
  data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
)sql";

// One camera, images 1 and 2 with two keypoints each, one pair: keypoints 0-1 and 1-0.
constexpr char kRows[] = R"sql(
INSERT INTO cameras VALUES (1, 0, 640, 480, x'0000000000407F4000000000000074400000000000006E40', 1);
INSERT INTO images (image_id, name, camera_id) VALUES (1, 'a.png', 1), (2, 'b.png', 1);
INSERT INTO keypoints VALUES (1, 2, 2, x'0000003F000000400000803F0000803F'), (2, 2, 2, x'0000003F000000400000803F0000803F');
INSERT INTO descriptors (image_id, rows, cols, data) VALUES (1, 2, 128, zeroblob(256)), (2, 2, 128, zeroblob(256));
INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) VALUES (2147483649, 2, 2,
  x'01000000000000000000000001000000', 2);
)sql";

// COLMAP 3.10 and 3.11.
constexpr char kPosePriors[] = R"sql(
CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, position BLOB, coordinate_system INTEGER NOT NULL,
  position_covariance BLOB);
INSERT INTO pose_priors VALUES (1, zeroblob(24), 1, NULL);
PRAGMA user_version = 3900;
)sql";
// COLMAP 3.12: one rig of two cameras, the second with a place in it.
constexpr char kRigs[] = R"sql(
CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, ref_sensor_id INTEGER NOT NULL,
  ref_sensor_type INTEGER NOT NULL);
CREATE TABLE rig_sensors (rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL,
  sensor_from_rig BLOB);
CREATE TABLE frames (frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, rig_id INTEGER NOT NULL);
CREATE TABLE frame_data (frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL,
  sensor_type INTEGER NOT NULL);
INSERT INTO rigs VALUES (1, 1, 0);
INSERT INTO rig_sensors VALUES (1, 2, 0, zeroblob(56));
INSERT INTO frames VALUES (1, 1);
INSERT INTO frame_data VALUES (1, 1, 1, 0), (1, 2, 2, 0);
)sql";
// COLMAP 3.14 and 4.0: another key of pose_priors, and what extracted the descriptors.
constexpr char kTypes[] = R"sql(
CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL, corr_data_id INTEGER NOT NULL,
  corr_sensor_id INTEGER NOT NULL, corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance BLOB,
  gravity BLOB, coordinate_system INTEGER NOT NULL);
ALTER TABLE descriptors ADD COLUMN type INTEGER NOT NULL DEFAULT 0;
PRAGMA user_version = 4000;
)sql";

class ColmapDatabase : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        testing::TempDir() + "/database_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    path_ = folder_ + "/a.db";
  }
  void Make(const std::string& sql) {
    fs::remove(path_);
    SQLite::Database database(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("PRAGMA synchronous = OFF");
    database.exec(sql);
  }
  // Everything that is read; "" or the error's message.
  static std::string ReadAll(const std::string& path) {
    auto database = OpenColmapDatabase(path);
    if (!database.ok()) return database.error().message;
    const Status status = WithDatabaseErrors(path, [&]() -> Status {
      CAIRN_RETURN_IF_ERROR(ReadDatabaseCameras(*database));
      CAIRN_ASSIGN_OR_RETURN(const auto images, ReadDatabaseImages(*database));
      for (const DatabaseImage& image : images) {
        CAIRN_RETURN_IF_ERROR(ReadDatabaseKeypoints(*database, image.image_id));
        CAIRN_ASSIGN_OR_RETURN(const int num_descriptors, ReadNumDescriptors(*database, image.image_id));
        CAIRN_ASSIGN_OR_RETURN(const auto descriptors, ReadDatabaseDescriptors(*database, image.image_id));
        EXPECT_EQ(num_descriptors, descriptors.rows());
      }
      CAIRN_RETURN_IF_ERROR(ReadDatabaseTwoViewGeometries(*database, 1));
      return Ok();
    });
    return status.ok() ? "" : status.error().message;
  }
  std::string MessageWith(const std::string& damage) {
    Make(std::string(kTables) + kRows + damage);
    return ReadAll(path_);
  }
  std::string folder_, path_;
};

TEST_F(ColmapDatabase, EveryVersionsSchemaIsRead) {
  const std::string prior_columns =
      "ALTER TABLE images ADD COLUMN prior_qw REAL; ALTER TABLE images ADD COLUMN prior_tx REAL;";
  for (const std::string& more : {std::string(""), prior_columns, std::string(kPosePriors),
                                  std::string(kPosePriors) + kRigs, std::string(kTypes) + kRigs}) {
    Make(std::string(kTables) + more + kRows);
    ASSERT_EQ(ReadAll(path_), "") << more;
    auto database = OpenColmapDatabase(path_);
    const auto geometries = ReadDatabaseTwoViewGeometries(*database, 1);
    ASSERT_EQ(geometries->size(), 1u);
    EXPECT_EQ(geometries->front().image_id1, 1u);
    EXPECT_EQ(geometries->front().image_id2, 2u);
    EXPECT_THAT(geometries->front().inliers, testing::ElementsAre(Match{0, 1}, Match{1, 0}));  // ascending
    EXPECT_EQ(ReadDatabaseKeypoints(*database, 1)->at(0).x, 0.5f);
    EXPECT_EQ(ReadDatabaseCameras(*database)->at(1).params, (PooledVector<double>{500, 320, 240}));
  }
}

TEST_F(ColmapDatabase, CopiesKeepForeignTablesAndGainTheColumnsThatOldVersionsLack) {
  std::string old_tables = kTables;
  const std::string columns = ", F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB";
  old_tables.erase(old_tables.find(columns), columns.size());
  Make(old_tables + kRows + kRigs + "PRAGMA journal_mode = WAL;");
  {
    auto database = OpenColmapDatabase(path_);
    ASSERT_TRUE(database.ok()) << database.error().message;
    CopyColmapDatabase(*database, folder_ + "/copy.db");
  }
  EXPECT_EQ(ReadAll(folder_ + "/copy.db"), "");
  SQLite::Database copy(folder_ + "/copy.db");
  EXPECT_TRUE(HasColumn(copy, "two_view_geometries", "qvec"));
  EXPECT_EQ(copy.execAndGet("SELECT count(*) FROM frame_data").getInt(), 2);
  EXPECT_EQ(copy.execAndGet("PRAGMA journal_mode").getString(), "delete");
}

TEST_F(ColmapDatabase, KeypointsOfTwoFourAndSixColumns) {
  const auto read = [&](int columns, const std::string& data) {
    Make(std::string(kTables) + kRows +
         fmt::format("UPDATE keypoints SET rows = 1, cols = {}, data = x'{}' WHERE image_id = 1", columns,
                     data));
    auto database = OpenColmapDatabase(path_);
    return ReadDatabaseKeypoints(*database, 1).value().at(0);
  };
  const std::string one = "0000803F", two = "00000040", zero = "00000000", minus_two = "000000C0";
  EXPECT_EQ(read(2, one + two).y, 2);
  EXPECT_EQ(read(2, one + two).scale, 1);
  EXPECT_EQ(read(2, one + two).orientation, 0);
  EXPECT_EQ(read(4, one + two + two + one).scale, 2);
  EXPECT_EQ(read(4, one + two + two + one).orientation, 1);
  // An affine shape of scale 2, turned by a quarter: a11 a12 a21 a22 = 0 -2 2 0.
  const Keypoint affine = read(6, one + two + zero + minus_two + two + zero);
  EXPECT_EQ(affine.x, 1);
  EXPECT_EQ(affine.y, 2);
  EXPECT_EQ(affine.scale, 2);
  EXPECT_NEAR(affine.orientation, M_PI / 2, 1e-6);
}

TEST_F(ColmapDatabase, DamagedRowsAreNamed) {
  const auto update = [&](const std::string& table, const std::string& set, const std::string& where) {
    return MessageWith("UPDATE " + table + " SET " + set + " WHERE " + where);
  };
  EXPECT_THAT(update("cameras", "width = -5", "1"), HasSubstr("table cameras, row 1: width is -5"));
  EXPECT_THAT(update("cameras", "model = 99", "1"), HasSubstr("row 1: unknown camera model number 99"));
  EXPECT_THAT(update("cameras", "params = x'01'", "1"), HasSubstr("table cameras, row 1: a blob of 1 bytes"));
  EXPECT_THAT(update("cameras", "height = 'tall'", "1"), HasSubstr("height is no integer"));
  EXPECT_THAT(update("images", "name = 'a.png'", "image_id = 2"),
              HasSubstr("table images, row 2: image 1 has the same name, 'a.png'"));
  EXPECT_THAT(
      MessageWith(
          "CREATE TABLE plain AS SELECT * FROM images; DROP TABLE images; ALTER TABLE plain RENAME TO "
          "images; UPDATE images SET image_id = 1"),
      HasSubstr("a table lacks the key by which it is read"));
  // A key by which they can be read, but that lets an image have two rows.
  const std::string two_rows =
      "CREATE TABLE plain (image_id, name, camera_id, PRIMARY KEY (image_id, name)) WITHOUT ROWID; INSERT "
      "INTO "
      "plain SELECT image_id, name, camera_id FROM images; DROP TABLE images; ALTER TABLE plain RENAME TO "
      "images; UPDATE images SET image_id = 1";
  EXPECT_THAT(MessageWith(two_rows), HasSubstr("table images, row 1: another image has the same number"));
  SQLite::Database opened = OpenColmapDatabase(path_).value();
  EXPECT_THAT(ReadDatabaseTwoViewGeometries(opened, 1).error().message,
              HasSubstr("table keypoints, row 1: the image has two rows"));
  EXPECT_THAT(update("images", "name = 'a' || char(10) || 'b.png'", "image_id = 2"),
              HasSubstr("has a control character"));
  EXPECT_THAT(update("images", "image_id = -3", "image_id = 2"),
              HasSubstr("table images, row -3: image_id is -3"));
  EXPECT_THAT(update("images", "camera_id = 99999999999", "image_id = 2"),
              HasSubstr("table images, row 2: camera_id"));
  EXPECT_THAT(update("keypoints", "rows = -1", "image_id = 1"),
              HasSubstr("table keypoints, row 1: rows is -1"));
  EXPECT_THAT(update("keypoints", "rows = 4000000000", "image_id = 1"),
              HasSubstr("table keypoints, row 1: rows is"));
  EXPECT_THAT(update("keypoints", "cols = 3", "image_id = 1"), HasSubstr("3 columns, expected 2, 4 or 6"));
  EXPECT_THAT(update("keypoints", "data = NULL", "image_id = 1"),
              HasSubstr("blob of 0 bytes, expected 2 x 2"));
  EXPECT_THAT(update("keypoints", "data = x'0000C07F000000400000803F0000803F'", "image_id = 1"),
              HasSubstr("keypoint 0 is not finite"));
  EXPECT_THAT(update("descriptors", "data = x'0102'", "image_id = 2"),
              HasSubstr("table descriptors, row 2: blob of 2 bytes, expected 2 x 128"));
  EXPECT_THAT(update("descriptors", "cols = 64", "image_id = 2"), HasSubstr("64 columns, expected 128"));
  EXPECT_THAT(update("two_view_geometries", "rows = -2", "1"),
              HasSubstr("table two_view_geometries, row 2147483649: rows is -2"));
  EXPECT_THAT(update("two_view_geometries", "cols = 3", "1"), HasSubstr("cols is 3"));
  EXPECT_THAT(update("two_view_geometries", "data = zeroblob(15)", "1"), HasSubstr("blob of 15 bytes"));
  EXPECT_THAT(update("two_view_geometries", "config = 77", "1"), HasSubstr("config is 77"));
  EXPECT_THAT(update("two_view_geometries", "data = x'00000000020000000000000001000000'", "1"),
              HasSubstr("matches keypoints 0 and 2 of images with 2 and 2 keypoints"));
  EXPECT_THAT(update("two_view_geometries", "data = x'02000000000000000000000001000000'", "1"),
              HasSubstr("matches keypoints 2 and 0 of images with 2 and 2 keypoints"));
  EXPECT_THAT(update("two_view_geometries", "pair_id = pair_id + 5", "1"),
              HasSubstr("a pair of the images 1 and 7"));
  EXPECT_THAT(update("two_view_geometries", "pair_id = 2147483648", "1"),
              HasSubstr("a pair of the images 1 and 1"));
  EXPECT_THAT(update("two_view_geometries", "pair_id = -7", "1"), HasSubstr("row -7: pair_id is -7"));
}

TEST_F(ColmapDatabase, NumbersBeginWithZero) {
  EXPECT_EQ(MessageWith(
                "UPDATE cameras SET camera_id = 0; UPDATE images SET image_id = 0, camera_id = 0 WHERE "
                "image_id = 1; UPDATE keypoints SET image_id = 0 WHERE image_id = 1; UPDATE descriptors SET "
                "image_id = 0 WHERE image_id = 1; UPDATE two_view_geometries SET pair_id = 2"),
            "");
  SQLite::Database database = OpenColmapDatabase(path_).value();
  EXPECT_EQ(ReadDatabaseCameras(database)->begin()->first, 0u);
  EXPECT_EQ(ReadDatabaseImages(database)->at(0).image_id, 0u);
  const auto geometries = ReadDatabaseTwoViewGeometries(database, 1).value();
  EXPECT_EQ(geometries.at(0).image_id1, 0u);
  EXPECT_EQ(geometries.at(0).image_id2, 2u);
  EXPECT_EQ(PairIdFromImageIds(1, 2), 2147483649);  // the smaller number times 2^31 - 1, and the other one
  EXPECT_EQ(PairIdFromImageIds(2, 1), 2147483649);
  EXPECT_EQ(ImageIdsFromPairId(2147483649), std::pair(ImageId{1}, ImageId{2}));
  constexpr ImageId kLast = 2147483646;
  EXPECT_EQ(ImageIdsFromPairId(PairIdFromImageIds(3, kLast)), std::pair(ImageId{3}, kLast));
}

TEST_F(ColmapDatabase, CamerasSayWhetherTheirFocalLengthIsKnown) {
  Make(std::string(kTables) + kRows);
  SQLite::Database database(path_, SQLite::OPEN_READWRITE);
  Camera camera = ReadDatabaseCameras(database)->at(1);
  for (const bool is_known : {false, true}) {
    camera.camera_id = is_known ? 7 : 8;
    camera.has_focal_prior = is_known;
    WriteDatabaseCamera(database, camera);
    EXPECT_EQ(ReadDatabaseCameras(database)->at(camera.camera_id).has_focal_prior, is_known);
  }
  EXPECT_EQ(database.execAndGet("SELECT prior_focal_length FROM cameras WHERE camera_id = 7").getInt(), 1);
}

TEST_F(ColmapDatabase, WhatIsWrittenOfAPairIsRead) {
  Make(std::string(kTables) + kRows);
  TwoViewGeometry written{.image_id1 = 1, .image_id2 = 2, .config = TwoViewConfig::kCalibrated};
  written.inliers = {{0, 1}, {1, 0}};
  written.F << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  written.E = written.F.array() + 10;
  written.H = written.F.array() + 20;
  {
    SQLite::Database database(path_, SQLite::OPEN_READWRITE);
    database.exec("DELETE FROM two_view_geometries");
    WriteDatabaseTwoViewGeometry(database, written);
    // COLMAP reads a quaternion and a translation.
    EXPECT_EQ(database.execAndGet("SELECT hex(qvec) FROM two_view_geometries").getString(),
              std::string(64, '0'));
    EXPECT_EQ(database.execAndGet("SELECT hex(tvec) FROM two_view_geometries").getString(),
              std::string(48, '0'));
  }
  SQLite::Database database = OpenColmapDatabase(path_).value();
  const TwoViewGeometry read = ReadDatabaseTwoViewGeometries(database, 1).value().at(0);
  EXPECT_EQ(read.config, written.config);
  EXPECT_EQ(read.inliers, written.inliers);
  EXPECT_EQ(read.F, written.F);
  EXPECT_EQ(read.E, written.E);
  EXPECT_EQ(read.H, written.H);
}

TEST_F(ColmapDatabase, OneDescriptorOfAnotherLengthIsRefused) {
  EXPECT_THAT(
      MessageWith(
          "DELETE FROM two_view_geometries; UPDATE keypoints SET rows = 1, data = zeroblob(8); UPDATE "
          "descriptors SET rows = 1, cols = 64, data = zeroblob(64)"),
      HasSubstr("table descriptors, row 1: 64 columns, expected 128"));
}

TEST_F(ColmapDatabase, LearnedDescriptorsAreRefusedWithASentence) {
  const std::string as_floats =
      "UPDATE descriptors SET cols = 512, data = zeroblob(1024) WHERE image_id = 1;";
  EXPECT_THAT(MessageWith(as_floats),
              HasSubstr("table descriptors, row 1: 512 bytes a descriptor: not SIFT's"));
  EXPECT_THAT(MessageWith(std::string(kTypes) + "UPDATE descriptors SET type = 1"),
              HasSubstr("of extractor type 1: not SIFT's 128 bytes"));
}

TEST_F(ColmapDatabase, ImagesWithoutKeypointsAreFine) {
  EXPECT_EQ(MessageWith("DELETE FROM two_view_geometries; DELETE FROM keypoints; DELETE FROM descriptors"),
            "");
  EXPECT_EQ(MessageWith("DELETE FROM two_view_geometries; UPDATE keypoints SET rows = 0, data = NULL;"
                        "UPDATE descriptors SET rows = 0, cols = 0, data = NULL"),
            "");
}

TEST_F(ColmapDatabase, OtherFilesAreToldApart) {
  EXPECT_THAT(ReadAll(path_), HasSubstr("no such file"));
  std::ofstream(path_).flush();
  EXPECT_THAT(ReadAll(path_), HasSubstr("not a SQLite database (0 bytes"));
  std::ofstream(path_) << "# cameras\n1 PINHOLE 640 480 500 500 320 240\n";
  EXPECT_THAT(ReadAll(path_), HasSubstr("not a SQLite database"));
  EXPECT_THAT(ReadAll(folder_), HasSubstr("is a folder, expected a file"));
  Make("CREATE TABLE bookmarks (url TEXT); CREATE TABLE history (url TEXT)");
  EXPECT_THAT(ReadAll(path_),
              HasSubstr("not COLMAP's: expected the tables cameras, images, keypoints, descriptors "
                        "and two_view_geometries, found bookmarks, history"));
  EXPECT_THAT(MessageWith("ALTER TABLE two_view_geometries RENAME TO inlier_matches"),
              HasSubstr("without the table two_view_geometries; open it once with COLMAP"));
  EXPECT_THAT(MessageWith("ALTER TABLE cameras RENAME COLUMN params TO parameters"),
              HasSubstr("table cameras has no column params: a version of COLMAP's database"));
}

TEST_F(ColmapDatabase, WriteAheadLogsAreReadAndNothingIsChanged) {
  Make(std::string(kTables) + kRows);
  fs::create_directories(folder_ + "/taken");
  const std::string taken = folder_ + "/taken/a.db";
  {
    SQLite::Database writer(path_, SQLite::OPEN_READWRITE);
    writer.exec(
        "PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0; UPDATE images SET name = 'log.png' WHERE "
        "image_id = 2");
    for (const char* suffix : {"", "-wal"})
      fs::copy_file(path_ + suffix, taken + suffix);  // as a crash leaves them
    // While another program has it open: reads what that program has committed, and nothing else.
    writer.exec("BEGIN; UPDATE images SET name = 'uncommitted.png' WHERE image_id = 2");
    auto database = OpenColmapDatabase(path_);
    ASSERT_TRUE(database.ok()) << database.error().message;
    EXPECT_EQ(ReadDatabaseImages(*database)->at(1).name, "log.png");
    writer.exec("COMMIT");
    EXPECT_EQ(ReadDatabaseImages(*database)->at(1).name, "log.png");  // one state for as long as it is open
  }
  const std::string bytes = *ReadFile(taken), log = *ReadFile(taken + "-wal");
  {
    auto database = OpenColmapDatabase(taken);
    ASSERT_TRUE(database.ok()) << database.error().message;
    EXPECT_EQ(ReadDatabaseImages(*database)->at(1).name, "log.png");
  }
  EXPECT_EQ(*ReadFile(taken), bytes);
  EXPECT_EQ(*ReadFile(taken + "-wal"), log);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ + "/taken"), fs::directory_iterator()), 2);
}

TEST_F(ColmapDatabase, WalModeWithoutALogLeavesNothingBeside) {
  Make(std::string(kTables) + kRows + "PRAGMA journal_mode = WAL;");
  const std::string bytes = *ReadFile(path_);
  EXPECT_EQ(ReadAll(path_), "");
  EXPECT_EQ(*ReadFile(path_), bytes);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(ColmapDatabase, WaitsForAWriterAndThenSaysThatThereIsOne) {
  Make(std::string(kTables) + kRows);
  SQLite::Database writer(path_, SQLite::OPEN_READWRITE);
  writer.exec("BEGIN EXCLUSIVE; UPDATE images SET name = 'late.png' WHERE image_id = 2");
  const auto locked = OpenColmapDatabase(path_);
  ASSERT_FALSE(locked.ok());
  EXPECT_EQ(locked.error().code, ErrorCode::kBusy);
  EXPECT_THAT(locked.error().message, HasSubstr("another program is writing to it (waited 5 s)"));
  std::thread ends([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    writer.exec("COMMIT");
  });
  auto database = OpenColmapDatabase(path_);
  ends.join();
  ASSERT_TRUE(database.ok()) << database.error().message;
  EXPECT_EQ(ReadDatabaseImages(*database)->at(1).name, "late.png");
}

TEST_F(ColmapDatabase, TruncationsAndFlippedBytesAreErrorsOrValidReadings) {
  Make(std::string("PRAGMA page_size = 512;") + kTables + kRows);
  const std::string bytes = *ReadFile(path_);
  int num_errors = 0;
  const auto read = [&](const std::string& damaged) {
    std::ofstream(path_, std::ios::binary) << damaged;
    const std::string message = ReadAll(path_);
    if (message.empty()) return;
    ++num_errors;
    EXPECT_THAT(message, HasSubstr("a.db"));
  };
  for (size_t size = 0; size < bytes.size(); size += 97) read(bytes.substr(0, size));
  EXPECT_EQ(num_errors, static_cast<int>((bytes.size() + 96) / 97));
  for (size_t i = 0; i < bytes.size(); i += 29) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(~damaged[i]);
    read(damaged);
  }
}

}  // namespace
}  // namespace cairn
