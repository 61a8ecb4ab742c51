#include "stages/reconstruct/by_colmap/mapper.h"

#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/reconstruct/fake_colmap.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class MapperTest : public testing::Test {
 protected:
  void SetUp() override {
    work_ = testing::TempDir() + "/mapper_test";
    fs::remove_all(work_);
    fs::create_directories(work_);
  }
  Result<std::vector<ColmapModel>> Run(const SyntheticSurvey& survey, const MapperOptions& options = {}) {
    SetUp();
    NoProgress progress;
    return RunMapper(survey.input, work_, options, work_, progress);
  }
  Error RunError(const MapperOptions& options = {}) {
    const auto models = Run(MakeSyntheticSurvey(3, 1), options);
    EXPECT_FALSE(models.ok());
    return models.ok() ? Error{} : models.error();
  }
  std::string work_;
};

TEST_F(MapperTest, FailureShowsTheLastLines) {
  const FakeColmap colmap("echo Loading cameras; echo 'Check failed: disk on fire' >&2; exit 1");
  const Error error = RunError();
  EXPECT_EQ(error.code, ErrorCode::kFailed);
  EXPECT_THAT(error.message,
              AllOf(HasSubstr("exit code 1"), HasSubstr("Loading cameras\n"), HasSubstr("disk on fire")));
}

TEST_F(MapperTest, CrashNamesTheSignal) {
  const FakeColmap colmap("kill -ABRT $$");
  EXPECT_THAT(RunError().message, AllOf(HasSubstr("exit code 134"), HasSubstr("it printed nothing")));
}

TEST_F(MapperTest, HangIsEndedAtTheTimeLimit) {
  const FakeColmap colmap("echo 'Registering image #2 (3)'; sleep 600");
  const Error error = RunError({.max_hours = 0.5 / 3600});
  EXPECT_EQ(error.code, ErrorCode::kFailed);
  EXPECT_THAT(error.message,
              AllOf(HasSubstr("max_hours = 0.000138889"), HasSubstr("Registering image #2 (3)")));
}

TEST_F(MapperTest, SuccessWithoutAModelIsAnError) {
  const FakeColmap colmap("echo done");
  const Error error = RunError();
  EXPECT_EQ(error.code, ErrorCode::kFailed);
  EXPECT_THAT(error.message, HasSubstr("left no model"));
}

TEST_F(MapperTest, DamagedModelIsCorrupt) {
  const FakeColmap colmap(
      "while [ \"$1\" != --output_path ]; do shift; done; mkdir $2/0; for f in cameras images points3D; do "
      "echo x > "
      "$2/0/$f.bin; done");
  EXPECT_EQ(RunError().code, ErrorCode::kCorrupt);
}

TEST_F(MapperTest, MissingProgramSaysWhatToInstall) {
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nowhere", 1);
  const Error error = RunError();
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.message, HasSubstr("apt install colmap"));
}

TEST_F(MapperTest, NothingToStartFromIsNoData) {
  SyntheticSurvey survey = MakeSyntheticSurvey(3, 1);
  for (TwoViewGeometry& geometry : survey.input.geometries)
    geometry.inliers.resize(16);  // too few for a pose
  const auto models = Run(survey);
  ASSERT_FALSE(models.ok());
  EXPECT_EQ(models.error().code, ErrorCode::kNoData) << models.error().message;
  EXPECT_THAT(models.error().message,
              AllOf(HasSubstr("3 images with 3 verified pairs (the best of 16 matches)"),
                    HasSubstr("max_num_features")));
}

TEST_F(MapperTest, SameBytesOnEveryRun) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(8, 3);
  const auto one = Run(survey);
  ASSERT_TRUE(one.ok()) << one.error().message;
  const auto two = Run(survey);
  ASSERT_TRUE(two.ok());
  ASSERT_EQ(one->size(), two->size());
  ASSERT_EQ((*one)[0].images.size(), 8u);
  EXPECT_EQ((*one)[0].cameras.at(1).params, (*two)[0].cameras.at(1).params);
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_EQ((*one)[0].images[i].cam_from_world.translation, (*two)[0].images[i].cam_from_world.translation);
    EXPECT_EQ((*one)[0].images[i].cam_from_world.rotation.coeffs(),
              (*two)[0].images[i].cam_from_world.rotation.coeffs());
  }
}

}  // namespace
}  // namespace cairn::reconstruct
