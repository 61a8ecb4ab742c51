#include "pipeline/exchange/export/map_capture.h"

#include <filesystem>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/files/file.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// Two images a metre apart that look along +z, and three landmarks: the first is seen by both, the second by
// image 7, the third projects beside image 9, whatever the map says.  Up is -y, as images have it.
MapRows SmallMap() {
  MapRows rows;
  rows.name = "hall";
  Camera camera;
  camera.camera_id = 1;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 320, 240};
  rows.cameras = {camera};
  rows.frame.scale_sigma_ratio = 0.01;
  rows.frame.source = "odometry";
  rows.floor_from_world.rotation =
      Eigen::Quaterniond::FromTwoVectors(-Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ());
  rows.landmarks.resize(3);
  rows.landmarks[0].position = {1, 0, 2};
  rows.landmarks[0].scale_m = 0.02;
  rows.landmarks[1].position = {0, 0, 5};
  rows.landmarks[2].position = {9, 0, 2};
  rows.descriptors.resize(3, kSiftDescriptorDim);
  for (int i = 0; i < 3; ++i) rows.descriptors.row(i).setConstant(static_cast<uint8_t>(10 * i + 1));
  Pose right;
  right.translation = {-1, 0, 0};
  rows.images = {{7, "b.png", 1, Pose(), -1, {0, 1}}, {9, "a.png", 1, right, -1, {0, 2}}};
  return rows;
}

class MapCaptureTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        testing::TempDir() + "/map_capture_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
  }
  std::string folder_;
};

TEST_F(MapCaptureTest, ImagesSeeTheMapsLandmarksWhereTheyProject) {
  const auto captures = WriteMapCaptures(SmallMap(), folder_);
  ASSERT_TRUE(captures.ok()) << captures.error().message;
  ASSERT_EQ(captures->size(), 1u);
  EXPECT_EQ(captures->front().session, "hall");
  EXPECT_EQ(captures->front().num_images, 2);
  EXPECT_EQ(captures->front().num_keypoints, 3);
  const auto capture = ReadCapture(folder_ + "/hall");
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 2u);
  EXPECT_EQ(capture->images[0].name, "a.png");
  EXPECT_EQ(capture->images[0].cam_from_world->translation.x(), -1);
  EXPECT_EQ(capture->frame->scale_sigma_ratio, 0.01);
  EXPECT_EQ(capture->frame->source, "odometry");
  const Camera& camera = capture->cameras.at(1);
  const auto left = ReadCaptureFeatures(capture->features.at("b.png"), camera);
  const auto right = ReadCaptureFeatures(capture->features.at("a.png"), camera);
  ASSERT_TRUE(left.ok() && right.ok());
  ASSERT_EQ(left->keypoints.size(), 2u);
  ASSERT_EQ(right->keypoints.size(), 1u);
  EXPECT_EQ(left->keypoints[0].x, 320 + 500 * 0.5);
  EXPECT_EQ(right->keypoints[0].x, 320);
  EXPECT_EQ(left->keypoints[0].scale, 5);  // 0.02 m, 2 m away
  EXPECT_EQ(left->keypoints[1].scale, 2);  // not known
  EXPECT_NEAR(left->keypoints[0].orientation, -std::numbers::pi / 2, 1e-6);
  EXPECT_EQ(left->descriptors.row(0), right->descriptors.row(0));
  EXPECT_EQ(left->descriptors(1, 0), 11);
  EXPECT_TRUE(capture->features.at("a.png").are_landmarks);
}

TEST_F(MapCaptureTest, EachSessionIsACaptureUnderItsName) {
  MapRows rows = SmallMap();
  rows.sessions = {"monday", "tuesday", "gone"};
  rows.images[0].name = "tuesday/b.png";
  rows.images[1].name = "monday/deep/a.png";
  const auto captures = WriteMapCaptures(rows, folder_);
  ASSERT_TRUE(captures.ok()) << captures.error().message;
  ASSERT_EQ(captures->size(), 2u);
  EXPECT_EQ(captures->at(0).session, "monday");
  EXPECT_EQ(captures->at(1).folder, folder_ + "/tuesday");
  EXPECT_EQ(ReadCapture(folder_ + "/monday")->images[0].name, "deep/a.png");
  EXPECT_EQ(ReadCapture(folder_ + "/tuesday")->images[0].name, "b.png");
}

TEST_F(MapCaptureTest, PosesAreInTheFrameInWhichTheSurveyStatedThem) {
  MapRows rows = SmallMap();
  rows.camera_from_given.translation = {0, 0, 0.25};
  ASSERT_TRUE(WriteMapCaptures(rows, folder_).ok());
  EXPECT_EQ(ReadCapture(folder_ + "/hall")->images[0].cam_from_world->translation,
            Eigen::Vector3d(-1, 0, -0.25));
}

TEST_F(MapCaptureTest, SameMapGivesTheSameBytesAndKeepsDates) {
  ASSERT_TRUE(WriteMapCaptures(SmallMap(), folder_).ok());
  const std::string path = folder_ + "/hall/features.db";
  const auto date = fs::last_write_time(path);
  const std::string bytes = *ReadFile(path);
  ASSERT_TRUE(WriteMapCaptures(SmallMap(), folder_).ok());
  EXPECT_EQ(fs::last_write_time(path), date);
  fs::remove_all(folder_);
  ASSERT_TRUE(WriteMapCaptures(SmallMap(), folder_).ok());
  EXPECT_TRUE(bytes == *ReadFile(path));
}

TEST_F(MapCaptureTest, TheMapItselfIsKeptBesideThem) {
  const std::string map = testing::TempDir() + "/map_of_captures";
  ASSERT_TRUE(WriteFileAtomically(map, "the map's bytes").ok());
  ASSERT_TRUE(WriteMapCaptures(SmallMap(), folder_, map).ok());
  EXPECT_EQ(*ReadFile(folder_ + "/" + kCapturedMapFile), "the map's bytes");
  ASSERT_TRUE(WriteMapCaptures(SmallMap(), folder_).ok());
  EXPECT_FALSE(fs::exists(folder_ + "/" + kCapturedMapFile));
}

TEST_F(MapCaptureTest, MapOfWhichNothingIsSeenTwiceIsRefused) {
  MapRows rows = SmallMap();
  rows.images[1].landmarks = {2};
  const auto captures = WriteMapCaptures(rows, folder_);
  ASSERT_FALSE(captures.ok());
  EXPECT_EQ(captures.error().code, ErrorCode::kNoData);
  EXPECT_THAT(captures.error().message, HasSubstr("map 'hall': no landmark is seen by two of its 2 images"));
  EXPECT_FALSE(fs::exists(folder_));
}

TEST_F(MapCaptureTest, NameOfAMapLeadsToNoOtherFolder) {
  MapRows rows = SmallMap();
  rows.name = "../../hall\" two\n";
  const auto captures = WriteMapCaptures(rows, folder_);
  ASSERT_TRUE(captures.ok()) << captures.error().message;
  EXPECT_EQ(captures->front().folder, folder_ + "/_._.._hall__two_");
  EXPECT_TRUE(fs::exists(folder_ + "/_._.._hall__two_/features.db"));
  rows.name = "";
  EXPECT_EQ(NameOfMap(rows), "map");
  rows.name = std::string(200, 'x');
  EXPECT_EQ(NameOfMap(rows), std::string(100, 'x'));
}

TEST(OptionsOfMap, AreThoseThatDifferAndSayNothingOfItsSurvey) {
  int num_features = 2000, radius = 3;
  std::string pairs = "auto", choice = "regions";
  const std::vector<std::pair<std::string, OptionTable>> stages = {
      {"extract_features", {{.name = "max_num_features", .value = &num_features, .help = ""}}},
      {"match_features",
       {{.name = "pairs", .value = &pairs, .help = ""},
        {.name = "radius", .value = &radius, .help = "", .max = 9}}},
      {"emit_map", {{.name = "landmarks", .value = &choice, .help = ""}}}};
  MapHead head;
  head.name = "hall";
  head.stage_options = {{"extract_features", "max_num_features = 2000\n"},
                        {"match_features", "pairs = \"frustum\"\nradius = 99\n"},
                        {"emit_map", "landmarks = \"all\"\nof_an_older_program = 7\n"},
                        {"gone", "x = 1\n"}};
  const auto text = OptionsOfMap(head, stages);
  ASSERT_TRUE(text.ok()) << text.error().message;
  EXPECT_EQ(*text, "\n[emit_map]\nlandmarks = 'all'\n");
  head.stage_options["emit_map"] = "no toml";
  EXPECT_EQ(OptionsOfMap(head, stages).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn::pipeline
