#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap/cameras_text.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "core/line/program_identity.h"
#include "tests/core/capture/features_database.h"
#include "tests/extract_features/capture_fixture.h"

namespace cairn::extract_features {
namespace {

namespace fs = std::filesystem;

// Four images that an earlier run extracted to features.db.
class ExtractFeaturesReuse : public ExtractFeaturesTest {
 protected:
  void SetUp() override {
    ExtractFeaturesTest::SetUp();
    for (int i = 0; i < 4; ++i) AddImage(Name(i), BlobImage(i));
    ASSERT_TRUE(ExtractTo("features.db", {}).ok());
  }

  static std::string Name(int i) { return "image" + std::to_string(i) + ".png"; }
  void Replace(int i, uint64_t seed) { cv::imwrite(root_ + "/images/" + Name(i), BlobImage(seed)); }
  void ListAgain() { ASSERT_TRUE(WriteImagesText(root_ + "/images.txt", images_).ok()); }

  // Runs again over features.db and tells how many images were taken over; the bytes must be a clean run's.
  int TakenOver() {
    const auto summary = ExtractTo("features.db", {.previous = true}, 2, options_);
    EXPECT_TRUE(summary.ok()) << summary.error().message;
    if (!summary.ok()) return -1;
    const auto clean = ExtractTo("clean.db", {}, 1, options_);
    EXPECT_TRUE(clean.ok());
    EXPECT_EQ(clean->num_taken_over, 0);
    EXPECT_EQ(clean->num_keypoints, summary->num_keypoints);
    EXPECT_EQ(*HashFile(root_ + "/features.db"), *HashFile(root_ + "/clean.db"));
    EXPECT_EQ(*HashFile(root_ + "/features.db.reuse"), *HashFile(root_ + "/clean.db.reuse"));
    return summary->num_taken_over;
  }

  ExtractFeaturesOptions options_;
};

TEST_F(ExtractFeaturesReuse, TakesOverAllImagesWhereNothingChanged) { EXPECT_EQ(TakenOver(), 4); }

TEST_F(ExtractFeaturesReuse, ComputesAReplacedImageAlone) {
  Replace(2, 17);
  EXPECT_EQ(TakenOver(), 3);
  EXPECT_EQ(TakenOver(), 4);
}

TEST_F(ExtractFeaturesReuse, AddedAndRemovedImagesLeaveTheOthersAlone) {
  AddImage("a first one.png", BlobImage(20));
  EXPECT_EQ(TakenOver(), 4);
  images_.erase(images_.begin() + 1);
  ListAgain();
  EXPECT_EQ(TakenOver(), 4);
}

TEST_F(ExtractFeaturesReuse, GivenFeaturesAreKnownByTheirContents) {
  Camera camera = FeaturesCamera(2);
  camera.width = 640;
  camera.height = 480;
  ASSERT_TRUE(
      WriteCamerasText(root_ + "/cameras.txt", {{1, ReadCapture(root_)->cameras.at(1)}, {2, camera}}).ok());
  images_.push_back({"log/1.png", 2, Pose()});
  images_.push_back({"log/2.png", 2, Pose()});
  ListAgain();
  fs::create_directories(root_ + "/features");
  const std::string path = SessionFeaturesPath(root_, "log");
  ASSERT_TRUE(
      WriteFeaturesDatabase(path, camera, {{"1.png", RandomFeatures(1, 9)}, {"2.png", RandomFeatures(2, 9)}})
          .ok());
  EXPECT_EQ(TakenOver(), 4);
  EXPECT_EQ(TakenOver(), 6);
  ASSERT_TRUE(
      WriteFeaturesDatabase(path, camera, {{"1.png", RandomFeatures(1, 9)}, {"2.png", RandomFeatures(3, 9)}})
          .ok());
  EXPECT_EQ(TakenOver(), 5);
  // A shard leaves out what an earlier output has.
  const auto shard = ExtractTo("shard.db", {.files = {root_ + "/features.db"}, .shard = Shard{1, 1}});
  ASSERT_TRUE(shard.ok()) << shard.error().message;
  EXPECT_EQ(shard->num_images, 0);
}

TEST_F(ExtractFeaturesReuse, ARenamedImageIsTheSameImage) {
  fs::rename(root_ + "/images/" + Name(0), root_ + "/images/zebra.png");
  images_[0].name = "zebra.png";
  ListAgain();
  EXPECT_EQ(TakenOver(), 4);
}

TEST_F(ExtractFeaturesReuse, ImagesThatChangePlacesAreFoundByTheirContents) {
  Replace(0, 3);
  Replace(3, 0);
  EXPECT_EQ(TakenOver(), 4);
}

TEST_F(ExtractFeaturesReuse, MasksOptionsAndCamerasOfAnotherSizeCount) {
  fs::create_directories(root_ + "/masks");
  options_.masks = "masks";
  EXPECT_EQ(TakenOver(), 4) << "no mask yet";
  cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(255));
  cv::imwrite(root_ + "/masks/" + Name(1), mask);
  EXPECT_EQ(TakenOver(), 3);
  mask(cv::Rect(0, 0, 160, 240)) = 0;
  cv::imwrite(root_ + "/masks/" + Name(1), mask);
  EXPECT_EQ(TakenOver(), 3);
  options_.sift.contrast_threshold = 0.03;
  EXPECT_EQ(TakenOver(), 0);
  options_.panorama.num_panorama_views = 8;
  EXPECT_EQ(TakenOver(), 4) << "there are no panoramas";
}

TEST_F(ExtractFeaturesReuse, AnImageThatCannotBeReadAnyMoreIsARejectAgain) {
  std::ofstream(root_ + "/images/" + Name(1)) << "no image";
  EXPECT_EQ(TakenOver(), 3);
  Camera camera;
  camera.width = 100;
  camera.height = 80;
  camera.params = {90, 50, 40};
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, camera}}).ok());
  EXPECT_EQ(ExtractTo("features.db", {.previous = true}).error().code, ErrorCode::kNoData)
      << "no image has its camera's size any more";
}

TEST_F(ExtractFeaturesReuse, PanoramasAreTakenOverWithAllTheirViews) {
  Camera panorama;
  panorama.model = CameraModel::kEquirectangular;
  panorama.width = 320;
  panorama.height = 240;
  ASSERT_TRUE(WriteCamerasText(root_ + "/cameras.txt", {{1, panorama}}).ok());
  EXPECT_EQ(TakenOver(), 0) << "pinhole images of the same size before";
  EXPECT_EQ(TakenOver(), 4);
  Replace(1, 30);
  EXPECT_EQ(TakenOver(), 3);
  options_.panorama.num_panorama_views = 8;
  EXPECT_EQ(TakenOver(), 0);
}

TEST_F(ExtractFeaturesReuse, DamagedFilesAreComputedAnew) {
  const std::string path = root_ + "/features.db.reuse";
  const std::string whole = *ReadFile(path);
  for (const size_t length : {size_t{0}, size_t{5}, size_t{60}, whole.size() - 1}) {
    std::ofstream(path, std::ios::binary) << whole.substr(0, length);
    EXPECT_EQ(TakenOver(), 0) << length;
  }
  for (const size_t position : {size_t{3}, size_t{20}, size_t{50}, whole.size() / 2, whole.size() - 3}) {
    std::string damaged = whole;
    damaged[position] ^= 1;
    std::ofstream(path, std::ios::binary) << damaged;
    EXPECT_EQ(TakenOver(), 0) << position;
  }
  fs::remove(path);
  EXPECT_EQ(TakenOver(), 0);
  EXPECT_EQ(TakenOver(), 4);
  std::ofstream(root_ + "/features.db", std::ios::binary) << "no database";
  EXPECT_EQ(TakenOver(), 0);
  fs::resize_file(root_ + "/features.db", 4096);
  EXPECT_EQ(TakenOver(), 0);
}

TEST_F(ExtractFeaturesReuse, RowsThatAreNotWhatTheReuseFileSaysAreComputed) {
  {
    SQLite::Database database(root_ + "/features.db", SQLite::OPEN_READWRITE);
    database.exec(
        "UPDATE keypoints SET data = (SELECT data FROM keypoints WHERE image_id = 2), rows = "
        "(SELECT rows FROM keypoints WHERE image_id = 2) WHERE image_id = 1");
    database.exec("DELETE FROM descriptors WHERE image_id = 4");
  }
  EXPECT_EQ(TakenOver(), 2);
}

TEST_F(ExtractFeaturesReuse, AnotherProgramsFeaturesAreNotTakenOver) {
  std::string bytes = *ReadFile(root_ + "/features.db.reuse");
  const size_t identity = bytes.find(ProgramIdentity());
  ASSERT_NE(identity, std::string::npos);
  bytes.replace(identity, 32, std::string(32, '0'));
  bytes.resize(bytes.size() - 16);
  const ContentHash hash = HashContents(bytes);
  BlobWriter end;
  end.UInt64(hash.high);
  end.UInt64(hash.low);
  std::ofstream(root_ + "/features.db.reuse", std::ios::binary) << bytes << end.Take();
  const auto summary = ExtractTo("features.db", {.previous = true});
  EXPECT_EQ(summary->num_taken_over, 0);
  EXPECT_THAT(summary->not_reused, testing::ElementsAre(testing::HasSubstr("written by another program")));
}

TEST_F(ExtractFeaturesReuse, ShardsMergeToTheSameBytes) {
  for (int i = 4; i < 7; ++i) AddImage(Name(i), BlobImage(i));
  ASSERT_TRUE(ExtractTo("clean.db", {}).ok());
  std::vector<std::string> shards;
  int num_images = 0;
  for (int i = 1; i <= 3; ++i) {
    shards.push_back(root_ + "/shard" + std::to_string(i) + ".db");
    const auto shard = ExtractTo("shard" + std::to_string(i) + ".db", {.shard = Shard{i, 3}});
    ASSERT_TRUE(shard.ok()) << shard.error().message;
    num_images += shard->num_images;
    EXPECT_LE(shard->num_images, 3);
  }
  EXPECT_EQ(num_images, 7);
  auto merged = ExtractTo("merged.db", {.files = shards});
  EXPECT_EQ(merged->num_taken_over, 7);
  EXPECT_EQ(*HashFile(root_ + "/merged.db"), *HashFile(root_ + "/clean.db"));
  shards.erase(shards.begin() + 1);  // its node died
  merged = ExtractTo("merged2.db", {.files = shards});
  EXPECT_EQ(merged->num_taken_over, 5);
  EXPECT_EQ(*HashFile(root_ + "/merged2.db"), *HashFile(root_ + "/clean.db"));
}

TEST_F(ExtractFeaturesReuse, AShardLeavesOutWhatNamedFilesHaveAndMayBeEmpty) {
  AddImage(Name(4), BlobImage(4));
  for (int i = 1; i <= 6; ++i) {
    const auto shard =
        ExtractTo("shard.db", {.previous = true, .files = {root_ + "/features.db"}, .shard = Shard{i, 6}});
    ASSERT_TRUE(shard.ok()) << shard.error().message;
    EXPECT_EQ(shard->num_images, i == 5 ? 1 : 0) << i;
    EXPECT_EQ(shard->num_taken_over, 0);
    EXPECT_TRUE(OpenColmapDatabase(root_ + "/shard.db").ok());
    EXPECT_TRUE(fs::exists(root_ + "/shard.db.reuse"));
  }
}

TEST_F(ExtractFeaturesReuse, NamedFilesMustBeDatabases) {
  EXPECT_EQ(ExtractTo("x.db", {.files = {root_ + "/absent.db"}}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ExtractTo("x.db", {.files = {root_ + "/images.txt"}}).error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(fs::exists(root_ + "/x.db"));
  fs::remove(root_ + "/features.db.reuse");
  const auto summary = ExtractTo("x.db", {.files = {root_ + "/features.db"}});
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(summary->num_taken_over, 0);
}

}  // namespace
}  // namespace cairn::extract_features
