#include "pipeline/exchange/export/colmap_export.h"

#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

Camera SmallCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240};
  return camera;
}

// Two images a metre apart, two landmarks; the second is seen by image 7 only and lies behind image 9.
TEST(Export, MapLandmarksBecomePointsSeenWhereTheyProject) {
  MapRows rows;
  rows.cameras = {SmallCamera()};
  Pose right;
  right.translation = {-1, 0, 0};
  Pose behind;
  behind.translation = {0, 0, -10};
  rows.landmarks.resize(2);
  rows.landmarks[0].position = {1, 0, 2};
  rows.landmarks[1].position = {0, 0, 5};
  rows.images = {{7, "a.png", 1, Pose(), -1, {0, 1}},
                 {9, "b.png", 1, right, -1, {0}},
                 {11, "c.png", 1, behind, -1, {1}}};
  const ColmapModel model = ModelFromMap(rows);
  ASSERT_EQ(model.points.size(), 2u);
  EXPECT_THAT(model.points[0].track, ElementsAre(Pair(7, 0), Pair(9, 0)));
  EXPECT_THAT(model.points[1].track, ElementsAre(Pair(7, 1)));
  EXPECT_EQ(model.images[0].keypoints[0].position, Eigen::Vector2d(320 + 500 * 0.5, 240));
  EXPECT_EQ(model.images[1].keypoints[0].position, Eigen::Vector2d(320, 240));
  EXPECT_EQ(model.images[1].keypoints[0].point_id, 1u);
  EXPECT_TRUE(model.images[2].keypoints.empty());
}

Classes SmallClasses() {
  Classes classes;
  classes.cameras = {SmallCamera()};
  Pose right;
  right.translation = {-1, 0, 0};
  classes.images = {{7, "a.png", 1, Pose(), Pose()}, {9, "b.png", 1, right, right}};
  FeatureClass feature;
  feature.class_id = 40;
  feature.position = {1, 0, 2};
  feature.reprojection_error_px = 0.5;
  feature.observations = {{7, 3, {570.25, 240, 2, 0}}, {9, 1, {320.5, 240, 2, 0}}};
  classes.classes = {feature};
  return classes;
}

TEST(Export, ClassesBecomeTracksOfTheirObservations) {
  const auto model = ModelFromClasses(SmallClasses(), nullptr);
  ASSERT_TRUE(model.ok());
  EXPECT_EQ(model->points[0].point_id, 41u);
  EXPECT_THAT(model->points[0].track, ElementsAre(Pair(7, 0), Pair(9, 0)));
  EXPECT_EQ(model->images[0].keypoints[0].position, Eigen::Vector2d(570.25, 240));
}

TEST(Export, KeypointsOfTheDatabaseKeepTheirIndices) {
  ImageKeypoints keypoints = {{7, {{1, 1}, {2, 2}, {3, 3}, {570.25, 240}}}, {9, {{4, 4}, {320.5, 240}}}};
  const auto model = ModelFromClasses(SmallClasses(), &keypoints);
  ASSERT_TRUE(model.ok());
  EXPECT_THAT(model->points[0].track, ElementsAre(Pair(7, 3), Pair(9, 1)));
  EXPECT_EQ(model->images[0].keypoints.size(), 4u);
  EXPECT_EQ(model->images[0].keypoints[3].point_id, 41u);
  EXPECT_EQ(model->images[0].keypoints[2].point_id, kNoPoint);
  keypoints[9].resize(1);
  EXPECT_THAT(ModelFromClasses(SmallClasses(), &keypoints).error().message,
              HasSubstr("keypoint 1 of image 9 (b.png), which has 1 keypoints"));
}

TEST(Export, ColmapAnalyzesTheModel) {
  const std::string folder = testing::TempDir() + "/export_model";
  fs::remove_all(folder);
  fs::create_directories(folder);
  const auto model = ModelFromClasses(SmallClasses(), nullptr);
  ASSERT_TRUE(WriteColmapModel(*model, ModelFormat::kBinary, folder).ok());
  const std::string log = folder + "/log";
  ASSERT_EQ(
      std::system(("QT_QPA_PLATFORM=offscreen colmap model_analyzer --path " + folder + " > " + log + " 2>&1")
                      .c_str()),
      0);
  const std::string text = *ReadFile(log);
  EXPECT_THAT(text, HasSubstr("Registered images: 2"));
  EXPECT_THAT(text, HasSubstr("Points: 1"));
  EXPECT_THAT(text, HasSubstr("Observations: 2"));
}

}  // namespace
}  // namespace cairn::pipeline
