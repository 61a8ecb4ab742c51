#include "stages/match_features/match_features.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/colmap_database.h"
#include "core/file.h"
#include "core/random.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A features.db of `num_images` cameras side by side that see the same 80 points, each with its own
// descriptor.
class MatchFeaturesTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/match_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  void WriteFeatures(int num_images, const std::function<void(SQLite::Database&)>& damage = nullptr) {
    Camera camera;
    camera.model = CameraModel::kPinhole;
    camera.width = 640;
    camera.height = 480;
    camera.params = {500, 500, 320, 240};
    Random random(3);
    std::vector<Eigen::Vector3d> points;
    DescriptorMatrix descriptors(80, kDescriptorDim);
    for (int i = 0; i < 80; ++i) {
      points.emplace_back(random.Uniform(-0.8, 0.8), random.Uniform(-0.6, 0.6), random.Uniform(2, 4));
      Eigen::Matrix<double, 1, kDescriptorDim> d;
      for (int k = 0; k < kDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 4);
      descriptors.row(i) = (d * 512 / d.norm()).array().round().cwiseMin(255.0).cast<uint8_t>();
    }
    const Status status =
        WriteDatabase(folder_ + "/features.db", kColmapSchema, [&](SQLite::Database& database) {
          WriteDatabaseCamera(database, camera);
          for (int i = 0; i < num_images; ++i) {
            const ImageId image_id = static_cast<ImageId>(i + 1);
            const std::string name = "image" + std::to_string(i) + ".png";
            Pose pose;
            pose.translation = Eigen::Vector3d(-0.2 * i, 0, 0);
            Features features;
            features.descriptors = descriptors;
            for (const Eigen::Vector3d& point : points) {
              const Eigen::Vector2d pixel = *ImageFromCamera(camera, pose * point);
              features.keypoints.push_back(
                  {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 2, 0});
            }
            WriteDatabaseImage(database, {image_id, name, 1});
            WriteDatabaseFeatures(database, image_id, features);
            capture_.images.push_back({name, 1, pose});
          }
          if (damage) damage(database);
          return Ok();
        });
    ASSERT_TRUE(status.ok()) << status.error().message;
  }

  Result<MatchFeaturesSummary> Match(bool with_poses, int num_threads = 2) {
    NoProgress progress;
    return MatchFeatures(folder_ + "/features.db", with_poses ? &capture_ : nullptr, {},
                         folder_ + "/matches.db", num_threads, progress);
  }

  std::string folder_;
  Capture capture_;
};

TEST_F(MatchFeaturesTest, FindsAllPairsWithAndWithoutPoses) {
  WriteFeatures(4);
  for (const bool with_poses : {true, false}) {
    const auto summary = Match(with_poses);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    EXPECT_EQ(summary->pairs, with_poses ? "frustum" : "exhaustive");
    EXPECT_EQ(summary->num_pairs_verified, 6);
    EXPECT_GE(summary->num_inliers, 6 * 75);
    auto database = OpenDatabaseReadOnly(folder_ + "/matches.db");
    const auto geometries = ReadDatabaseTwoViewGeometries(*database, 15);
    ASSERT_EQ(geometries->size(), 6u);
    for (const struct Match& match : geometries->front().inliers) EXPECT_EQ(match.idx1, match.idx2);
  }
}

TEST_F(MatchFeaturesTest, SameBytesForAnyNumberOfThreads) {
  WriteFeatures(5);
  ASSERT_TRUE(Match(false, 1).ok());
  const std::string one = *HashFile(folder_ + "/matches.db");
  ASSERT_TRUE(Match(false, 4).ok());
  EXPECT_EQ(*HashFile(folder_ + "/matches.db"), one);
}

TEST_F(MatchFeaturesTest, OneImageIsAnErrorAndLeavesNoFile) {
  WriteFeatures(1);
  const auto summary = Match(true);
  ASSERT_FALSE(summary.ok());
  EXPECT_EQ(summary.error().code, ErrorCode::kNoData);
  EXPECT_THAT(summary.error().message, HasSubstr("1 image(s) with features, at least 2"));
  EXPECT_FALSE(fs::exists(folder_ + "/matches.db"));
}

TEST_F(MatchFeaturesTest, NoOverlapIsAnErrorThatSaysSo) {
  WriteFeatures(2);
  capture_.images[1].cam_from_world->rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY());
  const auto summary = Match(true);
  ASSERT_FALSE(summary.ok());
  EXPECT_THAT(summary.error().message, HasSubstr("do the images overlap"));
  EXPECT_FALSE(fs::exists(folder_ + "/matches.db"));
}

TEST_F(MatchFeaturesTest, DescriptorBlobOfWrongLengthNamesTheRow) {
  WriteFeatures(2, [](SQLite::Database& database) {
    database.exec("UPDATE descriptors SET data = x'0102' WHERE image_id = 2");
  });
  const auto summary = Match(true);
  EXPECT_EQ(summary.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(summary.error().message,
              HasSubstr("table descriptors, row 2: blob of 2 bytes, expected 80 x 128"));
}

TEST_F(MatchFeaturesTest, TruncatedDatabaseIsAnError) {
  WriteFeatures(3);
  const std::string bytes = *ReadFile(folder_ + "/features.db");
  std::ofstream(folder_ + "/features.db", std::ios::binary) << bytes.substr(0, 6000);
  EXPECT_EQ(Match(true).error().code, ErrorCode::kCorrupt);
  std::ofstream(folder_ + "/features.db", std::ios::binary);
  EXPECT_EQ(Match(true).error().code, ErrorCode::kCorrupt);
}

TEST_F(MatchFeaturesTest, ColmapMapperReconstructsFromOurMatches) {
  WriteFeatures(6);
  ASSERT_TRUE(Match(false).ok());
  fs::copy_file(folder_ + "/matches.db", folder_ + "/copy.db");
  fs::create_directories(folder_ + "/model");
  fs::create_directories(folder_ + "/images");
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap mapper --Mapper.init_min_tri_angle 4 --image_path " + folder_ +
      "/images --database_path " + folder_ + "/copy.db --output_path " + folder_ + "/model > " + folder_ +
      "/colmap.log 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << *ReadFile(folder_ + "/colmap.log");
  EXPECT_TRUE(fs::exists(folder_ + "/model/0/images.bin")) << *ReadFile(folder_ + "/colmap.log");
}

}  // namespace
}  // namespace cairn
