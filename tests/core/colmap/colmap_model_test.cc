#include "core/colmap/colmap_model.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Two cameras, three images (one without keypoints), two points.
ColmapModel SmallModel() {
  ColmapModel model;
  Camera pinhole;
  pinhole.camera_id = 2;
  pinhole.model = CameraModel::kPinhole;
  pinhole.width = 640;
  pinhole.height = 480;
  pinhole.params = {525.25, 524.75, 320, 240};
  Camera radial = pinhole;
  radial.camera_id = 7;
  radial.model = CameraModel::kOpenCv;
  radial.params = {500, 501, 319.5, 240.125, -0.1, 1.0 / 3, 1e-5, -2e-5};
  model.cameras = {{2, pinhole}, {7, radial}};
  Pose pose;
  pose.rotation = Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5);
  pose.translation = {1.25, -1.0 / 3, 0.1};
  Pose other = pose;
  other.translation.x() = -4;
  model.images = {{3, "left/a b.png", 7, pose, {{{10.5, 20.25}, 40}, {{1.0 / 3, 2}, kNoPoint}, {{3, 4}, 41}}},
                  {5, "right/a.png", 2, other, {{{11.5, 21}, 41}, {{12, 22}, 40}}},
                  {9, "last.png", 2, Pose(), {}}};
  model.points = {{40, {0.1, 1.0 / 3, 2e-7}, {255, 0, 17}, 0.75, {{3, 0}, {5, 1}}},
                  {41, {-5, 6, 7}, {1, 2, 3}, 1.5, {{5, 0}, {3, 2}}}};
  return model;
}

void ExpectSame(const ColmapModel& a, const ColmapModel& b, double tolerance) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (const auto& [camera_id, camera] : a.cameras) {
    const Camera& other = b.cameras.at(camera_id);
    EXPECT_EQ(camera.model, other.model);
    EXPECT_EQ(camera.width, other.width);
    EXPECT_EQ(camera.height, other.height);
    EXPECT_EQ(camera.params, other.params);
  }
  ASSERT_EQ(a.images.size(), b.images.size());
  for (size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(a.images[i].image_id, b.images[i].image_id);
    EXPECT_EQ(a.images[i].name, b.images[i].name);
    EXPECT_EQ(a.images[i].camera_id, b.images[i].camera_id);
    EXPECT_LE((a.images[i].cam_from_world.Matrix() - b.images[i].cam_from_world.Matrix()).norm(), tolerance);
    ASSERT_EQ(a.images[i].keypoints.size(), b.images[i].keypoints.size());
    for (size_t k = 0; k < a.images[i].keypoints.size(); ++k) {
      EXPECT_LE((a.images[i].keypoints[k].position - b.images[i].keypoints[k].position).norm(), tolerance);
      EXPECT_EQ(a.images[i].keypoints[k].point_id, b.images[i].keypoints[k].point_id);
    }
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].point_id, b.points[i].point_id);
    EXPECT_LE((a.points[i].position - b.points[i].position).norm(), tolerance);
    EXPECT_EQ(a.points[i].color, b.points[i].color);
    EXPECT_EQ(a.points[i].track, b.points[i].track);
  }
}

class ColmapModelTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/model_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    for (const char* folder : {"/a", "/b", "/c"}) fs::create_directories(root_ + folder);
  }
  void Write(const std::string& name, const std::string& bytes) {
    std::ofstream(root_ + "/" + name, std::ios::binary) << bytes;
  }
  std::string Read(const std::string& name) { return ReadFile(root_ + "/" + name).value(); }
  std::string MessageOf(const std::string& folder) {
    const auto model = ReadColmapModel(root_ + folder);
    return model.ok() ? "read" : model.error().message;
  }
  std::string root_;
};

TEST_F(ColmapModelTest, BothFormatsReadBackToTheSameBits) {
  for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
    ASSERT_TRUE(WriteColmapModel(SmallModel(), format, root_ + "/a").ok());
    const auto model = ReadColmapModel(root_ + "/a");
    ASSERT_TRUE(model.ok()) << model.error().message;
    ExpectSame(*model, SmallModel(), 0);
    for (const auto& entry : fs::directory_iterator(root_ + "/a")) fs::remove(entry);
  }
}

TEST_F(ColmapModelTest, ColmapConvertsOursToTheOtherFormatAndBack) {
  const auto convert = [&](const std::string& from, const std::string& to, const std::string& type) {
    return std::system(("QT_QPA_PLATFORM=offscreen colmap model_converter --input_path " + root_ + from +
                        " --output_path " + root_ + to + " --output_type " + type + " > " + root_ +
                        "/log 2>&1")
                           .c_str());
  };
  ColmapModel model_without_space = SmallModel();  // COLMAP's text reader ends names at a space
  model_without_space.images[0].name = "left/a.png";
  ASSERT_TRUE(WriteColmapModel(model_without_space, ModelFormat::kText, root_ + "/a").ok());
  ASSERT_EQ(convert("/a", "/b", "BIN"), 0) << Read("log");
  auto model = ReadColmapModel(root_ + "/b");
  ASSERT_TRUE(model.ok()) << model.error().message;
  ExpectSame(*model, model_without_space, 1e-12);

  for (const auto& entry : fs::directory_iterator(root_ + "/a")) fs::remove(entry);
  ASSERT_TRUE(WriteColmapModel(SmallModel(), ModelFormat::kBinary, root_ + "/a").ok());
  ASSERT_EQ(convert("/a", "/c", "TXT"), 0) << Read("log");
  model = ReadColmapModel(root_ + "/c");
  ASSERT_TRUE(model.ok()) << model.error().message;
  ExpectSame(*model, SmallModel(), 1e-12);
}

TEST_F(ColmapModelTest, EveryTruncationOfABinaryFileIsAnErrorThatNamesIt) {
  ASSERT_TRUE(WriteColmapModel(SmallModel(), ModelFormat::kBinary, root_ + "/a").ok());
  for (const std::string name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string bytes = Read("a/" + name);
    for (size_t size = 0; size < bytes.size(); ++size) {
      Write("a/" + name, bytes.substr(0, size));
      ASSERT_THAT(MessageOf("/a"), HasSubstr(name)) << size;
    }
    Write("a/" + name, bytes + "x");
    EXPECT_THAT(MessageOf("/a"), HasSubstr(name));
    Write("a/" + name, bytes);
  }
}

TEST_F(ColmapModelTest, FlippedBytesNeverCrash) {
  ASSERT_TRUE(WriteColmapModel(SmallModel(), ModelFormat::kBinary, root_ + "/a").ok());
  for (const std::string name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const std::string bytes = Read("a/" + name);
    for (size_t i = 0; i < bytes.size(); ++i) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(~damaged[i]);
      Write("a/" + name, damaged);
      const auto model = ReadColmapModel(root_ + "/a");
      if (!model.ok()) {
        EXPECT_THAT(model.error().message, HasSubstr(root_));
      }
    }
    Write("a/" + name, bytes);
  }
}

TEST_F(ColmapModelTest, BrokenTextNamesFileAndLine) {
  ASSERT_TRUE(WriteColmapModel(SmallModel(), ModelFormat::kText, root_ + "/a").ok());
  const std::string images = Read("a/images.txt"), points = Read("a/points3D.txt");
  Write("a/images.txt", "# header\n3 1 0 0 0 1 2\n\n");
  EXPECT_THAT(MessageOf("/a"), HasSubstr("images.txt:2: expected IMAGE_ID QW"));
  Write("a/images.txt", "# header\n3 2 0 0 0 1 2 3 7 a.png\n\n");
  EXPECT_THAT(MessageOf("/a"), HasSubstr("images.txt:2: quaternion of norm 2, expected 1"));
  // A number that stays none, whatever follows it.
  Write("a/images.txt", "# header\n3 1 0 0 0 1 2 3 7 a.png\n1 2 -5 3 4 -1\n");
  EXPECT_THAT(MessageOf("/a"), HasSubstr("images.txt:3"));
  Write("a/images.txt", images);
  Write("a/points3D.txt", "40 1 2 3 255 0 256 1\n");
  EXPECT_THAT(MessageOf("/a"), HasSubstr("points3D.txt:1: expected POINT3D_ID"));
  Write("a/points3D.txt", points + "42 1 2 3 0 0 0 1 3\n");
  EXPECT_THAT(MessageOf("/a"), HasSubstr("points3D.txt:4: expected POINT3D_ID"));
}

// A line's end in a name would make two images of one.
TEST_F(ColmapModelTest, NamesThatNoLineCanHoldAreNotWritten) {
  ColmapModel model = SmallModel();
  model.images[1].name = "right/a.png\n6 1 0 0 0 0 0 0 2 b.png";
  const Status status = WriteColmapModel(model, ModelFormat::kText, root_ + "/a");
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(status.error().message, HasSubstr("images.txt"));
  EXPECT_TRUE(fs::is_empty(root_ + "/a"));
  EXPECT_TRUE(WriteColmapModel(model, ModelFormat::kBinary, root_ + "/a").ok());
}

TEST_F(ColmapModelTest, ReferencesToWhatIsNotThereAreErrors) {
  const auto message_of = [&](const std::function<void(ColmapModel&)>& damage) {
    ColmapModel model = SmallModel();
    damage(model);
    EXPECT_TRUE(WriteColmapModel(model, ModelFormat::kBinary, root_ + "/a").ok());
    return MessageOf("/a");
  };
  EXPECT_THAT(message_of([](ColmapModel& m) { m.images[1].camera_id = 4; }),
              HasSubstr("image 5 (right/a.png) has camera 4, which cameras does not list"));
  EXPECT_THAT(message_of([](ColmapModel& m) { m.images[0].keypoints[1].point_id = 99; }),
              HasSubstr("image 3 (left/a b.png) sees point 99, which points3D does not list"));
  EXPECT_THAT(message_of([](ColmapModel& m) { m.points[0].track[1].second = 2; }),
              HasSubstr("the track of point 40 has keypoint 2 of image 5"));
  EXPECT_THAT(message_of([](ColmapModel& m) { m.images[1].image_id = 3; }),
              HasSubstr("image 3 is listed twice"));
  EXPECT_THAT(MessageOf("/b"), HasSubstr("not a COLMAP model"));
}

}  // namespace
}  // namespace cairn
