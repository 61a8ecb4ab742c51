#include "core/colmap/rig_config.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

using testing::HasSubstr;

class RigConfig : public testing::Test {
 protected:
  Result<std::vector<RigCamera>> Read(const std::string& text) const {
    EXPECT_TRUE(WriteFileAtomically(path_, text).ok());
    return ReadRigConfig(path_);
  }
  ~RigConfig() override { std::filesystem::remove(path_); }

  std::string path_ = testing::TempDir() + fmt::format("rig_config_{}.json", getpid());
};

// As https://colmap.github.io/rigs.html has it: the reference sensor need not be the first.
constexpr char kStereo[] = R"([{"cameras": [
  {"image_prefix": "rig/right/", "cam_from_rig_rotation": [0.7071067811865475, 0, 0.7071067811865475, 0],
   "cam_from_rig_translation": [-0.1, 0.2, 0.3],
   "camera_model_name": "OPENCV", "camera_params": [600, 610, 320, 240, 0.1, 0.01, 0, 0]},
  {"image_prefix": "rig/left/", "ref_sensor": true}]}])";

TEST_F(RigConfig, OfColmapIsRead) {
  const auto rig = *Read(kStereo);
  ASSERT_EQ(rig.size(), 2U);
  EXPECT_EQ(rig[0].image_prefix, "rig/left/");
  EXPECT_TRUE(rig[0].cam_from_rig.translation.isZero());
  EXPECT_FALSE(rig[0].camera);
  EXPECT_EQ(rig[1].image_prefix, "rig/right/");
  EXPECT_EQ(rig[1].cam_from_rig.translation, Eigen::Vector3d(-0.1, 0.2, 0.3));
  EXPECT_NEAR(rig[1].cam_from_rig.rotation.angularDistance(Eigen::Quaterniond::Identity()), M_PI / 2, 1e-9);
  EXPECT_NEAR(rig[1].cam_from_rig.rotation.y(), std::sqrt(0.5), 1e-9);
  ASSERT_TRUE(rig[1].camera);
  EXPECT_EQ(rig[1].camera->model, CameraModel::kOpenCv);
  EXPECT_EQ(rig[1].camera->params[1], 610);
}

TEST_F(RigConfig, RotationsAreWXYZ) {
  const std::string rig =
      R"([{"cameras": [{"image_prefix": "a/", "cam_from_rig_rotation": [0.5, -0.5, 0.5, 0.5]},
                                           {"image_prefix": "b/", "ref_sensor": true}]}])";
  const Eigen::Quaterniond rotation = Read(rig)->at(1).cam_from_rig.rotation;
  EXPECT_TRUE(rotation.coeffs().isApprox(Eigen::Vector4d(-0.5, 0.5, 0.5, 0.5), 1e-12)) << rotation.coeffs();
}

TEST_F(RigConfig, WhatIsWrittenIsRead) {
  auto rig = *Read(kStereo);
  const std::string text = RigConfigJson(rig);
  EXPECT_THAT(text.substr(0, text.find("right")),
              testing::Not(HasSubstr("cam_from_rig")));  // as COLMAP wants it
  const auto again = *Read(text);
  ASSERT_EQ(again.size(), 2U);
  EXPECT_EQ(RigConfigJson(again), text);
  rig[0].cam_from_rig.translation = {0, 0, 1};
  EXPECT_EQ((*Read(RigConfigJson(rig)))[0].cam_from_rig.translation, Eigen::Vector3d(0, 0, 1));
}

TEST_F(RigConfig, WhatIsNoneSaysWhat) {
  const auto expect = [&](const std::string& text, ErrorCode code, const std::string& message) {
    const auto rig = Read(text);
    ASSERT_FALSE(rig.ok()) << text;
    EXPECT_EQ(rig.error().code, code) << rig.error().message;
    EXPECT_THAT(rig.error().message, HasSubstr(message));
    EXPECT_THAT(rig.error().message, HasSubstr(path_));
  };
  for (const char* text :
       {"", "{", "[]", "{}", "[{}]", "[7]", R"([{"cameras": {}}])", R"([{"cameras": []}])"})
    expect(text, ErrorCode::kCorrupt, "expected a JSON list");
  const std::string camera = R"({"cameras": [{"image_prefix": "a/", "ref_sensor": true}]})";
  EXPECT_TRUE(Read("[" + camera + "]").ok());
  expect("[" + camera + "," + camera + "]", ErrorCode::kUnsupported, "2 rigs");
  const auto with = [](const std::string& second) {
    return R"([{"cameras": [{"image_prefix": "a/", "ref_sensor": true}, )" + second + "]}]";
  };
  expect(with("7"), ErrorCode::kCorrupt, "camera 2: expected an object");
  expect(with(R"({"image_prefix": 7})"), ErrorCode::kCorrupt, "image_prefix");
  expect(with(R"({"image_prefix": "", "ref_sensor": false})"), ErrorCode::kCorrupt, "image_prefix");
  expect(with(R"({"image_prefix": "b/"})"), ErrorCode::kCorrupt, "only the reference sensor");
  expect(with(R"({"image_prefix": "b/", "ref_sensor": true})"), ErrorCode::kCorrupt, "2 cameras are the");
  expect(with(R"({"image_prefix": "a/", "cam_from_rig_translation": [0, 0, 0]})"), ErrorCode::kCorrupt,
         "a/ is another camera's");
  expect(with(R"({"image_prefix": "b/", "cam_from_rig_rotation": [1, 0, 0]})"), ErrorCode::kCorrupt,
         "four numbers");
  expect(with(R"({"image_prefix": "b/", "cam_from_rig_rotation": [1, 0, 0, "0"]})"), ErrorCode::kCorrupt,
         "four numbers");
  expect(with(R"({"image_prefix": "b/", "cam_from_rig_rotation": [1, 1, 0, 0]})"), ErrorCode::kCorrupt,
         "of length 1");
  expect(with(R"({"image_prefix": "b/", "cam_from_rig_translation": 5})"), ErrorCode::kCorrupt,
         "three numbers");
  const std::string b = R"({"image_prefix": "b/", "cam_from_rig_translation": [0, 0, 0], )";
  expect(with(b + R"("camera_params": [1]})"), ErrorCode::kCorrupt, "camera_model_name");
  expect(with(b + R"("camera_model_name": "PINHOLE", "camera_params": [1]})"), ErrorCode::kCorrupt,
         "as many numbers");
  const auto unknown = Read(with(b + R"("camera_model_name": "EYE", "camera_params": [1]})"));
  EXPECT_EQ(unknown.error().code, ErrorCode::kUnsupported);
  expect(R"([{"cameras": [{"image_prefix": "b/", "cam_from_rig_translation": [0, 0, 0]}]}])",
         ErrorCode::kCorrupt, "0 cameras are the");
  EXPECT_EQ(ReadRigConfig("/nowhere/rig.json").error().code, ErrorCode::kNotFound);
}

TEST_F(RigConfig, NamesOfAnInstantDifferByTheirPrefixes) {
  const auto rig = *Read(kStereo);
  EXPECT_EQ(*NameInRig(rig, 0, "rig/left/7.jpg"), "rig/left/7.jpg");
  EXPECT_EQ(*NameInRig(rig, 1, "rig/left/7.jpg"), "rig/right/7.jpg");
  EXPECT_EQ(*NameInRig(rig, 1, "/data/rig/left/a/7.jpg"), "/data/rig/right/a/7.jpg");
  // The last that is one; not within a folder's name.
  EXPECT_EQ(*NameInRig(rig, 1, "/rig/left/rig/left/7.jpg"), "/rig/left/rig/right/7.jpg");
  EXPECT_EQ(*NameInRig(rig, 1, "/rig/left/big_rig/left/7.jpg"), "/rig/right/big_rig/left/7.jpg");
  for (const char* name : {"rig/right/7.jpg", "big_rig/left/7.jpg", "7.jpg", ""}) {
    const auto other = NameInRig(rig, 1, name);
    ASSERT_FALSE(other.ok()) << name;
    EXPECT_EQ(other.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(other.error().message, HasSubstr("rig/left/"));
  }
}

}  // namespace
}  // namespace cairn
