#include "stages/reconstruct/find_frame.h"

#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn::reconstruct {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Sixty images along +x, 0.1 m apart, that look up; reconstructed at a quarter of their size.
class FindFrameTest : public testing::Test {
 protected:
  void SetUp() override {
    capture_.root = testing::TempDir() + "/find_frame";
    std::filesystem::remove_all(capture_.root);
    std::filesystem::create_directories(capture_.root);
    for (int i = 0; i < 60; ++i) {
      capture_.images.push_back({fmt::format("{:02}.jpg", i), 1, std::nullopt});
      model_[capture_.images.back().name] = {Eigen::Quaterniond::Identity(), {-0.025 * i, 0, 0}};
    }
  }
  void WriteOdometry(double step_m, double step_of_half_m) {
    std::string text;
    double x = 0;
    for (int i = 0; i < 60; ++i) {
      text += fmt::format("{:02}.jpg {} 0 0 0 0 0 1\n", i, x);
      x += i % 20 < 10 ? step_m : step_of_half_m;
    }
    ASSERT_TRUE(WriteFileAtomically(capture_.root + "/odometry.txt", text).ok());
  }
  Result<Similarity> Find(const std::string& scale_from) {
    result_ = {};
    ReconstructOptions options;
    options.scale_from = scale_from;
    return FindFrame(model_, capture_, options, &result_);
  }
  Capture capture_;
  ModelPoses model_;
  ReconstructResult result_;
};

TEST_F(FindFrameTest, OdometryGivesMetresWhereItIsThere) {
  WriteOdometry(0.1, 0.1);
  for (const std::string from : {"auto", "odometry"}) {
    const auto similarity = Find(from);
    ASSERT_TRUE(similarity.ok()) << similarity.error().message;
    EXPECT_NEAR(similarity->scale, 4, 1e-9);
    EXPECT_EQ(result_.frame.source, "odometry");
    EXPECT_EQ(result_.frame.unit, "metre");
    EXPECT_GT(result_.scale_sigma_ratio, 0);
    EXPECT_LT(result_.scale_sigma_ratio, 0.01);
    EXPECT_GE(result_.residuals.size(), 3u);
    EXPECT_FALSE(result_.residuals[0].is_off);
    EXPECT_THAT(result_.warnings, IsEmpty());
  }
  ASSERT_TRUE(Find("none").ok());
  EXPECT_EQ(result_.frame.source, "none");
}

TEST_F(FindFrameTest, OdometryThatDisagreesWithTheImagesIsReported) {
  WriteOdometry(0.1, 0.2);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("the odometry and the images disagree by")));
}

TEST_F(FindFrameTest, WithoutOdometryNothingGivesAScale) {
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_THAT(result_.warnings, ElementsAre(HasSubstr("give odometry.txt, control_points or distances")));
  const auto asked = Find("odometry");
  ASSERT_FALSE(asked.ok());
  EXPECT_EQ(asked.error().code, ErrorCode::kNotFound);
}

TEST_F(FindFrameTest, OdometryThatStandsSaysNothingAndThatIsSaid) {
  WriteOdometry(0, 0);
  ASSERT_TRUE(Find("auto").ok());
  EXPECT_EQ(result_.frame.unit, "arbitrary");
  EXPECT_THAT(result_.warnings,
              ElementsAre(HasSubstr("moves over 0 pieces"), HasSubstr("nothing gives a scale")));
  EXPECT_EQ(Find("odometry").error().code, ErrorCode::kNoData);
}

TEST_F(FindFrameTest, OdometryThatCannotBeReadIsAnErrorAndNotIgnored) {
  ASSERT_TRUE(WriteFileAtomically(capture_.root + "/odometry.txt", "00.jpg 1 2\n").ok());
  EXPECT_EQ(Find("auto").error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn::reconstruct
