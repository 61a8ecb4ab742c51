#pragma once

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/colmap/colmap_database.h"
#include "stages/match_features/match_features.h"

namespace cairn::match_features {

// A features.db of `num_images` cameras side by side that see the same points, each with its
// own descriptor.
class MatchFeaturesTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/match_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }

  void WriteFeatures(int num_images, const std::function<void(SQLite::Database&)>& damage = nullptr) {
    Camera camera;
    camera.model = CameraModel::kPinhole;
    camera.width = 640;
    camera.height = 480;
    camera.params = {500, 500, 320, 240};
    Random random(3);
    std::vector<Eigen::Vector3d> points;
    DescriptorMatrix descriptors(num_points_, kSiftDescriptorDim);
    for (int i = 0; i < num_points_; ++i) {
      points.emplace_back(random.Uniform(-0.8, 0.8), random.Uniform(-0.6, 0.6), random.Uniform(2, 4));
      Eigen::Matrix<double, 1, kSiftDescriptorDim> d;
      for (int k = 0; k < kSiftDescriptorDim; ++k) d[k] = std::pow(random.Uniform(), 4);
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

  // Images from this one on show another place, so that words tell images apart.
  void ShowAnotherPlace(int first_image_id) {
    Random random(11);
    std::string bytes(80 * kSiftDescriptorDim, '\0');
    for (char& byte : bytes) byte = static_cast<char>(135 * std::pow(random.Uniform(), 4));
    SQLite::Database database(folder_ + "/features.db", SQLite::OPEN_READWRITE);
    SQLite::Statement update(database, "UPDATE descriptors SET data = ? WHERE image_id >= ?");
    update.bind(1, bytes.data(), static_cast<int>(bytes.size()));
    update.bind(2, first_image_id);
    update.exec();
  }

  Result<MatchFeaturesSummary> Match(bool with_poses, int num_threads = 2) {
    return MatchTo("matches.db", with_poses, {}, num_threads);
  }
  Result<MatchFeaturesSummary> MatchTo(const std::string& name, bool with_poses, const ReuseOptions& reuse,
                                       int num_threads = 2) {
    inputs_.features_path = folder_ + "/features.db";
    inputs_.capture = with_poses ? &capture_ : nullptr;
    NoProgress progress;
    return MatchFeatures(inputs_, options_, folder_ + "/" + name, seed_, num_threads, progress, reuse);
  }

  int num_points_ = 80;
  std::string folder_;
  Capture capture_;
  MatchFeaturesInputs inputs_;
  MatchFeaturesOptions options_;
  uint64_t seed_ = 0;
};

}  // namespace cairn::match_features
