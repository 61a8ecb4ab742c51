// The installed COLMAP matches and verifies the same features: configurations and stored matrices are the
// same in clear cases.
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/match_features/two_view_scene.h"

namespace cairn::match_features {
namespace {

struct Case {
  const char* name;
  TwoViewSceneOptions scene;
  bool has_focal_prior;
  TwoViewConfig config;
};

const Case kCases[] = {
    {"points in depth", {.num_points = 150, .num_outliers = 30}, true, TwoViewConfig::kCalibrated},
    {"a plane",
     {.num_points = 150, .num_outliers = 30, .is_flat = true},
     true,
     TwoViewConfig::kPlanarOrPanoramic},
    {"a rotation",
     {.num_points = 150, .num_outliers = 30, .baseline_m = 0},
     true,
     TwoViewConfig::kPlanarOrPanoramic},
    {"guessed focal length", {.num_points = 150, .num_outliers = 30}, false, TwoViewConfig::kUncalibrated},
    {"guessed focal length, a plane",
     {.num_points = 150, .num_outliers = 30, .is_flat = true},
     false,
     TwoViewConfig::kPlanarOrPanoramic},
};

TwoViewScene SceneOf(const Case& c) {
  TwoViewScene scene = MakeTwoViewScene(c.scene);
  scene.camera.camera_id = c.has_focal_prior ? 1 : 2;
  scene.camera.has_focal_prior = c.has_focal_prior;
  return scene;
}

// Images 1, 2 show the first case, 3, 4 the second, ...; descriptors of two cases have nothing in common.
void WriteScenes(const std::string& path) {
  const Status status = WriteDatabase(path, kColmapSchema, [](SQLite::Database& database) {
    Camera camera = SceneCamera();
    for (const bool has_focal_prior : {true, false}) {
      camera.camera_id = has_focal_prior ? 1 : 2;
      camera.has_focal_prior = has_focal_prior;
      WriteDatabaseCamera(database, camera);
    }
    ImageId image_id = 1;
    for (const Case& c : kCases) {
      const TwoViewScene scene = SceneOf(c);
      Features features;
      features.descriptors.resize(static_cast<Eigen::Index>(scene.matches.size()), kSiftDescriptorDim);
      for (int i = 0; i < features.descriptors.rows(); ++i)
        FillDescriptor(1000 * image_id + i, &features.descriptors, i);
      for (const auto* keypoints : {&scene.keypoints1, &scene.keypoints2}) {
        features.keypoints = *keypoints;
        WriteDatabaseImage(database, {image_id, std::to_string(image_id) + ".png", scene.camera.camera_id});
        WriteDatabaseFeatures(database, image_id, features);
        ++image_id;
      }
    }
    return Ok();
  });
  ASSERT_TRUE(status.ok()) << status.error().message;
}

TEST(VerifyBesideColmap, ConfigurationsAndStoredMatricesAreTheSame) {
  const std::string folder = testing::TempDir() + "/verify_beside_colmap";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  WriteScenes(folder + "/colmap.db");
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap exhaustive_matcher --SiftMatching.use_gpu 0 --database_path " +
      folder + "/colmap.db > " + folder + "/log 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << *ReadFile(folder + "/log");
  SQLite::Database database(folder + "/colmap.db", SQLite::OPEN_READWRITE);  // its journal is a WAL
  const auto geometries = ReadDatabaseTwoViewGeometries(database, 15);
  ASSERT_TRUE(geometries.ok()) << geometries.error().message;
  ASSERT_EQ(geometries->size(), std::size(kCases));
  for (size_t i = 0; i < std::size(kCases); ++i) {
    SCOPED_TRACE(kCases[i].name);
    const TwoViewScene scene = SceneOf(kCases[i]);
    const TwoViewGeometry ours =
        VerifyPair(scene.View1(std::nullopt), scene.View2(std::nullopt), scene.matches, {});
    const TwoViewGeometry& theirs = (*geometries)[i];
    EXPECT_EQ(ours.config, kCases[i].config);
    EXPECT_EQ(ours.config, theirs.config);
    EXPECT_EQ(ours.E.norm() > 0, theirs.E.norm() > 0);
    EXPECT_EQ(ours.F.norm() > 0, theirs.F.norm() > 0);
    EXPECT_EQ(ours.H.norm() > 0, theirs.H.norm() > 0);
    EXPECT_GE(NumTrueInliers(ours, 150), 145);
    EXPECT_GE(NumTrueInliers(ours, 150), 0.97 * NumTrueInliers(theirs, 150));
  }
}

}  // namespace
}  // namespace cairn::match_features
