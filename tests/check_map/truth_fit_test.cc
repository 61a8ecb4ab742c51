#include "stages/check_map/truth_fit.h"

#include <gtest/gtest.h>

#include "core/base/quantiles.h"
#include "core/base/random.h"

namespace cairn::check_map {
namespace {

Pose SomePose(Random* random, double spread_m) {
  const Eigen::Vector3d axis(random->Normal(0, 1), random->Normal(0, 1), random->Normal(0, 1));
  Pose pose;
  pose.rotation = Eigen::AngleAxisd(random->Uniform(-3, 3), axis.normalized());
  pose.translation = -(pose.rotation * Eigen::Vector3d(random->Uniform(-spread_m, spread_m),
                                                       random->Uniform(-spread_m, spread_m),
                                                       random->Uniform(-spread_m, spread_m)));
  return pose;
}

Similarity SomeSimilarity() {
  return {
      1.03, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized())), {4, -5, 6}};
}

// Fixes of 40 cameras; the truth is of cameras at `offset` to them, in another frame; every tenth is wrong.
std::vector<FixAndTruth> SomeFixes(const Pose& offset) {
  Random random(3);
  std::vector<FixAndTruth> fixes;
  for (int i = 0; i < 40; ++i) {
    const Pose fix = SomePose(&random, 2);
    fixes.push_back({fix, TransformPose(SomeSimilarity(), offset * fix)});
    if (i % 10 == 9) fixes.back().truth = SomePose(&random, 5);
  }
  return fixes;
}

TEST(FitTruth, FindsTheSimilarityThatMostFixesAgreeOn) {
  const auto fit = FitTruth(SomeFixes(Pose()), false);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->truth_from_map.scale, 1.03, 1e-4);
  EXPECT_LT(fit->truth_from_map.rotation.angularDistance(SomeSimilarity().rotation), 1e-4);
  EXPECT_LT((fit->truth_from_map.translation - SomeSimilarity().translation).norm(), 1e-3);
  EXPECT_LT(UpperMedian(fit->errors_m), 1e-4);
  EXPECT_LT(UpperMedian(fit->errors_deg), 1e-2);
  EXPECT_GT(fit->errors_m[9], 0.1);  // a wrong fix stays one
  EXPECT_EQ(RotationErrorDeg(fit->truth_cam_from_cam, Pose()), 0);
  EXPECT_EQ(fit->truth_cam_from_cam.translation.norm(), 0);
}

TEST(FitTruth, FindsTheOffsetOfAnotherCameraOfTheRigWhereAsked) {
  Pose offset{Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY())), {0.07, -0.01, 0.02}};
  const auto without = FitTruth(SomeFixes(offset), false), with = FitTruth(SomeFixes(offset), true);
  ASSERT_TRUE(without && with);
  EXPECT_GT(UpperMedian(without->errors_m), 0.02);
  EXPECT_LT(UpperMedian(with->errors_m), 0.002);
  EXPECT_LT(RotationErrorDeg(with->truth_cam_from_cam, offset), 0.1);
  EXPECT_LT((with->truth_cam_from_cam.translation - offset.translation).norm(), 0.003);
  EXPECT_NEAR(with->truth_from_map.scale, 1.03, 1e-3);
}

TEST(FitTruth, NothingWhereASimilarityIsNotDetermined) {
  std::vector<FixAndTruth> fixes = SomeFixes(Pose());
  EXPECT_TRUE(FitTruth({fixes.begin(), fixes.begin() + 6}, false));
  EXPECT_FALSE(FitTruth({fixes.begin(), fixes.begin() + 5}, false));
  EXPECT_FALSE(FitTruth({}, true));
  for (Pose FixAndTruth::*side : {&FixAndTruth::fix, &FixAndTruth::truth}) {  // one of them on a line
    std::vector<FixAndTruth> half = fixes;
    for (size_t i = 0; i < half.size(); ++i) {
      Pose& pose = half[i].*side;
      pose.translation = -(pose.rotation * Eigen::Vector3d(0.1 * static_cast<double>(i), 0, 0));
    }
    EXPECT_FALSE(FitTruth(half, false));
  }
  for (size_t i = 0; i < fixes.size(); ++i) {  // both
    fixes[i].fix.translation = -(fixes[i].fix.rotation * Eigen::Vector3d(0.1 * static_cast<double>(i), 0, 0));
    fixes[i].truth = fixes[i].fix;
  }
  EXPECT_FALSE(FitTruth(fixes, false));
  for (FixAndTruth& pair : fixes) pair.fix.translation.setZero();  // in a point
  EXPECT_FALSE(FitTruth(fixes, false));
}

}  // namespace
}  // namespace cairn::check_map
