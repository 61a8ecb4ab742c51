#include "stages/reconstruct/align.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

const Similarity kTruth{.scale = 3.7,
                        .rotation = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(),
                        .translation = {12, -40, 3}};

// Targets whose model positions are their world positions seen from the other frame.
std::vector<PositionTarget> TargetsAt(const std::vector<Eigen::Vector3d>& world, double sigma_m) {
  std::vector<PositionTarget> targets;
  for (const Eigen::Vector3d& x : world) {
    targets.push_back({.model = kTruth.rotation.conjugate() * (x - kTruth.translation) / kTruth.scale,
                       .world = x,
                       .sigma_m = Eigen::Vector3d::Constant(sigma_m)});
  }
  return targets;
}
Eigen::Vector3d TrueUp() { return kTruth.rotation.conjugate() * Eigen::Vector3d::UnitZ(); }

double RotationError(const Similarity& similarity) {
  return DegFromRad(similarity.rotation.angularDistance(kTruth.rotation));
}

TEST(AlignToPositions, RecoversAnExactSimilarity) {
  const auto targets = TargetsAt({{0, 0, 0}, {10, 0, 0}, {0, 10, 1}, {4, 5, 2}}, 0.05);
  const auto alignment = AlignToPositions(targets, TrueUp(), 5);
  ASSERT_TRUE(alignment.ok()) << alignment.error().message;
  EXPECT_NEAR(alignment->world_from_model.scale, kTruth.scale, 1e-6);
  EXPECT_LT(RotationError(alignment->world_from_model), 1e-4);
  EXPECT_LT((alignment->world_from_model.translation - kTruth.translation).norm(), 1e-4);
  for (const double residual : alignment->residuals_m) EXPECT_LT(residual, 1e-4);
}

// A straight street leaves the roll about itself to the cameras' up.
TEST(AlignToPositions, StraightLineIsLevelledByTheCamerasUp) {
  std::vector<Eigen::Vector3d> street;
  for (int i = 0; i < 20; ++i) street.emplace_back(8.0 * i, 3.0 * i, 0);
  const auto alignment = AlignToPositions(TargetsAt(street, 5), TrueUp(), 5);
  ASSERT_TRUE(alignment.ok());
  EXPECT_LT(RotationError(alignment->world_from_model), 0.01);
}

TEST(AlignToPositions, WrongTargetsHardlyCountAndAreOff) {
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 12; ++i) places.emplace_back(20.0 * (i % 4), 15.0 * (i / 4), 0.5 * i);
  std::vector<PositionTarget> targets = TargetsAt(places, 2);
  targets[3].world += Eigen::Vector3d(300, 0, 0);  // a fix of another street
  targets[7].world += Eigen::Vector3d(0, -150, 0);
  targets[8].world += Eigen::Vector3d(0, 0, 90);
  const auto alignment = AlignToPositions(targets, TrueUp(), 5);
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale, kTruth.scale, 0.01);
  EXPECT_LT(RotationError(alignment->world_from_model), 0.3);
  for (size_t i = 0; i < targets.size(); ++i)
    EXPECT_EQ(alignment->is_off[i], i == 3 || i == 7 || i == 8) << i << ": " << alignment->residuals_m[i];
  EXPECT_NEAR(alignment->residuals_m[3], 300, 2);
}

// A survey that looks straight down: the images' up is level, and the positions know better.
TEST(AlignToPositions, ManyGoodPositionsOverruleAWrongUp) {
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 25; ++i) places.emplace_back(30.0 * (i % 5), 30.0 * (i / 5), i % 3);
  const Eigen::Vector3d wrong_up = kTruth.rotation.conjugate() * Eigen::Vector3d::UnitX();
  const auto alignment = AlignToPositions(TargetsAt(places, 3), wrong_up, 5);
  ASSERT_TRUE(alignment.ok());
  EXPECT_LT(RotationError(alignment->world_from_model), 1);
}

TEST(AlignToPositions, NoiseAveragesOut) {
  Random random(5);
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 400; ++i) places.emplace_back(random.Uniform(0, 200), random.Uniform(0, 200), 0);
  std::vector<PositionTarget> targets = TargetsAt(places, 3);
  for (PositionTarget& target : targets) {
    for (int k = 0; k < 3; ++k) target.world[k] += random.Normal(0, 3);
  }
  const auto alignment = AlignToPositions(targets, TrueUp(), 5);
  ASSERT_TRUE(alignment.ok());
  EXPECT_NEAR(alignment->world_from_model.scale / kTruth.scale, 1, 0.01);
  EXPECT_LT(RotationError(alignment->world_from_model), 0.5);
}

TEST(AlignToPositions, RefusesWhatGivesNoScale) {
  const auto few = AlignToPositions(TargetsAt({{0, 0, 0}, {90, 0, 0}}, 5), TrueUp(), 5);
  ASSERT_FALSE(few.ok());
  EXPECT_THAT(few.error().message, HasSubstr("2 images with a known position, expected at least 3"));
  const auto close = AlignToPositions(TargetsAt({{0, 0, 0}, {3, 0, 0}, {0, 4, 0}}, 5), TrueUp(), 5);
  ASSERT_FALSE(close.ok());
  EXPECT_THAT(close.error().message, HasSubstr("gives no scale"));
  std::vector<PositionTarget> pinned = TargetsAt({{0, 0, 0}, {30, 0, 0}, {0, 40, 0}}, 1);
  for (PositionTarget& target : pinned) target.model.setZero();
  EXPECT_FALSE(AlignToPositions(pinned, TrueUp(), 5).ok());
}

TEST(TransformPose, KeepsWhatTheCameraSees) {
  const Pose cam_from_model{Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2).normalized(), {0.4, -1, 2}};
  const Pose cam_from_world = TransformPose(kTruth, cam_from_model);
  const Eigen::Vector3d point(1, 2, 7);
  EXPECT_LT((cam_from_world * (kTruth * point) - kTruth.scale * (cam_from_model * point)).norm(), 1e-9);
  EXPECT_LT((cam_from_world.Center() - kTruth * cam_from_model.Center()).norm(), 1e-9);
}

// Many times the same place with other errors: the scales found spread as the standard deviation says.
TEST(AlignToPositions, SaysHowWellItKnowsTheScale) {
  Random random(6);
  for (const double announced : {1.0, 0.5}) {  // of the errors' standard deviation
    double sum = 0;
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<Eigen::Vector3d> places;
      for (int i = 0; i < 30; ++i)
        places.emplace_back(random.Uniform(0, 60), random.Uniform(0, 40), random.Uniform(0, 2));
      std::vector<PositionTarget> targets = TargetsAt(places, 2 * announced);
      for (PositionTarget& target : targets) {
        target.sigma_m.z() = 6 * announced;
        target.world += Eigen::Vector3d(random.Normal(0, 2), random.Normal(0, 2), random.Normal(0, 6));
      }
      const auto alignment = AlignToPositions(targets, TrueUp(), 5);
      ASSERT_TRUE(alignment.ok());
      sum += std::pow(
          std::log(alignment->world_from_model.scale / kTruth.scale) / alignment->scale_sigma_ratio, 2);
    }
    EXPECT_GT(std::sqrt(sum / 300), 0.8) << announced;
    // The loss hardly counts targets that err more than was said, and is as much less exact.
    EXPECT_LT(std::sqrt(sum / 300), announced < 1 ? 1.6 : 1.25);
  }
}

TEST(AlignToPositions, TheScaleErrsAboutTheMiddleOfWhatIsKnown) {
  std::vector<PositionTarget> targets = TargetsAt({{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {10, 10, 0}}, 0.1);
  const auto even = AlignToPositions(targets, TrueUp(), 5);
  EXPECT_LT((even->centre - Eigen::Vector3d(5, 5, 0)).norm(), 1e-3);
  EXPECT_NEAR(even->scale_sigma_ratio, 0.1 / std::sqrt(200), 1e-5);
  targets[0].sigma_m.x() = 1e5;  // says nothing of x
  const auto uneven = AlignToPositions(targets, TrueUp(), 5);
  EXPECT_LT((uneven->centre - Eigen::Vector3d(20.0 / 3, 5, 0)).norm(), 1e-3);
}

TEST(ScaleFromDistances, IsTheMedianRatio) {
  EXPECT_DOUBLE_EQ(ScaleFromDistances({{1, 2}, {2, 4.2}, {0.5, 9}}, 0.02)->scale, 2.1);
  EXPECT_DOUBLE_EQ(ScaleFromDistances({{1, 2}, {1, 3}}, 0.02)->scale, 2.5);
  EXPECT_FALSE(ScaleFromDistances({}, 0.02).ok());
  EXPECT_FALSE(ScaleFromDistances({{0, 2}}, 0.02).ok());
}

TEST(ScaleFromDistances, IsKnownAsWellAsTheyAreOrAsTheyAgree) {
  EXPECT_DOUBLE_EQ(ScaleFromDistances({{1, 2}}, 0.02)->sigma_ratio, 0.02);
  EXPECT_NEAR(ScaleFromDistances({{1, 2}, {1, 2}}, 0.02)->sigma_ratio, 0.02 / std::sqrt(2), 1e-12);
  EXPECT_NEAR(ScaleFromDistances({{1, 2}, {1, 2}, {1, 2}, {1, 2}}, 0.02)->sigma_ratio, 1.2533 * 0.01, 1e-12);
  // 2 and 3: 20 % off each, by the median absolute deviation 30 %.
  EXPECT_NEAR(ScaleFromDistances({{1, 2}, {1, 3}}, 0.02)->sigma_ratio, 1.4826 * 0.2 / std::sqrt(2), 1e-12);
}

TEST(LevelledFrame, FirstCameraIsTheOriginAndLooksAlongX) {
  // Two cameras that look along model x with their up (-y) along model -z: the model stands on its head.
  Pose pose;
  pose.rotation = Eigen::Quaterniond(
      (Eigen::Matrix3d() << 0, 1, 0, 0, 0, 1, 1, 0, 0).finished());  // rows: camera axes in the model
  pose.rotation = pose.rotation.normalized();
  Pose first = pose, second = pose;
  first.translation = -(pose.rotation * Eigen::Vector3d(5, 5, 5));
  second.translation = -(pose.rotation * Eigen::Vector3d(6, 5, 5));
  const Similarity frame = LevelledFrame({first, second}, 2);
  const Pose levelled = TransformPose(frame, first);
  EXPECT_LT(levelled.Center().norm(), 1e-9);
  EXPECT_LT((levelled.ViewingDirection() - Eigen::Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_LT((MeanUp({levelled}) - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT((TransformPose(frame, second).Center() - Eigen::Vector3d(2, 0, 0)).norm(), 1e-9);
}

}  // namespace
}  // namespace cairn::reconstruct
