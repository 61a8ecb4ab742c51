#include "runtime/localize/estimate.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "core/base/random.h"

namespace cairn {
namespace {

const Pose kTruth{Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(0.3, -1, 0.5).normalized())),
                  {100, -20, 3}};

PooledVector<PoseMeasurement> MakeScene(int num_inliers, int num_outliers, uint64_t seed) {
  Random random(seed);
  PooledVector<PoseMeasurement> measurements;
  for (int i = 0; i < num_inliers + num_outliers; ++i) {
    const Eigen::Vector3d in_cam(random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), random.Uniform(2, 8));
    PoseMeasurement measurement;
    measurement.point = kTruth.Inverse() * in_cam;
    measurement.ray.pixel_from_ray = 500 * Eigen::Matrix2d::Identity();
    measurement.ray.ray =
        in_cam.hnormalized() + Eigen::Vector2d(random.Normal(0, 0.002), random.Normal(0, 0.002));
    if (i >= num_inliers) measurement.ray.ray = {random.Uniform(-0.6, 0.6), random.Uniform(-0.5, 0.5)};
    measurements.push_back(measurement);
  }
  return measurements;
}

TEST(Estimate, FindsThePoseAmongNinetyPercentOutliers) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto measurements = MakeScene(25, 225, seed);
    EstimateOptions options;
    options.max_num_ransac_iterations = 20000;
    const auto estimate = EstimatePose(measurements, options, {}, seed);
    ASSERT_TRUE(estimate);
    EXPECT_LT(CenterErrorM(estimate->cam_from_world, kTruth), 0.1) << seed;
    EXPECT_GE(estimate->inliers.size(), 24u);
  }
}

TEST(Estimate, StopsSoonWhereAllAgree) {
  const auto estimate = EstimatePose(MakeScene(100, 0, 1), {}, {}, 0);
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->num_iterations, EstimateOptions().min_num_ransac_iterations);
  EXPECT_EQ(estimate->inliers.size(), 100u);
}

TEST(Estimate, PointsMayBeAsNearAsTheyLike) {
  auto measurements = MakeScene(40, 20, 4);
  Pose truth = kTruth;
  truth.translation *= 0.05;
  for (PoseMeasurement& measurement : measurements) measurement.point *= 0.05;  // 10 to 40 cm away
  const auto estimate = EstimatePose(measurements, {}, {}, 0);
  ASSERT_TRUE(estimate);
  EXPECT_LT(CenterErrorM(estimate->cam_from_world, truth), 0.005);
  EXPECT_GE(estimate->inliers.size(), 39u);
}

TEST(Estimate, SameSeedSameResult) {
  const auto measurements = MakeScene(40, 100, 3);
  const auto first = EstimatePose(measurements, {}, {}, 5);
  const auto second = EstimatePose(measurements, {}, {}, 5);
  EXPECT_EQ(first->cam_from_world.translation, second->cam_from_world.translation);
  EXPECT_EQ(first->inliers, second->inliers);
}

TEST(Estimate, FourMatchesAreTheLeast) {
  EXPECT_FALSE(EstimatePose(MakeScene(3, 0, 1), {}, {}, 0));
  EXPECT_TRUE(EstimatePose(MakeScene(4, 0, 1), {}, {}, 0));
  EXPECT_FALSE(EstimatePose({}, {}, {}, 0));
}

// The same points seen from two places.
TEST(EstimatePoses, BestFirstAndEachOfOtherMatches) {
  auto measurements = MakeScene(30, 10, 1);
  const Pose other = Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())), {0.5, 0, 0}};
  for (int i = 0; i < 25; ++i) {
    PoseMeasurement measurement = measurements[i];
    measurement.ray.ray = (other * (kTruth * measurement.point)).hnormalized();
    measurements.push_back(measurement);
  }
  const auto poses = EstimatePoses(measurements, 2, {}, {}, 0);
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_LT(CenterErrorM(poses[0].cam_from_world, kTruth), 0.05);
  EXPECT_LT(CenterErrorM(poses[1].cam_from_world, other * kTruth), 0.05);
  EXPECT_GE(poses[0].inliers.size(), 29u);
  EXPECT_GE(poses[1].inliers.size(), 25u);
  // The best is the same however many are asked for.
  const auto best = EstimatePose(measurements, {}, {}, 0);
  EXPECT_EQ(best->inliers, poses[0].inliers);
  EXPECT_LT(CenterErrorM(best->cam_from_world, poses[0].cam_from_world), 1e-3);
  // No two share more than nine tenths.
  const auto many = EstimatePoses(measurements, 8, {}, {}, 0);
  for (size_t a = 0; a < many.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      PooledVector<int> both;
      std::set_intersection(many[a].inliers.begin(), many[a].inliers.end(), many[b].inliers.begin(),
                            many[b].inliers.end(), std::back_inserter(both));
      EXPECT_LE(10 * both.size(), 9 * std::min(many[a].inliers.size(), many[b].inliers.size()));
    }
  }
}

// Of the rest alone, and by their numbers among all.
TEST(EstimateOtherPose, IsOfWhatTheFirstLeavesOver) {
  auto measurements = MakeScene(30, 0, 1);
  const Pose other = Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())), {0.5, 0, 0}};
  for (int i = 0; i < 30; i += 2)
    measurements[i].ray.ray = (other * (kTruth * measurements[i].point)).hnormalized();
  PoseEstimate first{kTruth, {}};
  for (int i = 1; i < 30; i += 2) first.inliers.push_back(i);
  const auto found = EstimateOtherPose(measurements, first, {}, {}, 0);
  ASSERT_TRUE(found);
  EXPECT_LT(CenterErrorM(found->cam_from_world, other * kTruth), 0.05);
  PooledVector<int> even;
  for (int i = 0; i < 30; i += 2) even.push_back(i);
  EXPECT_EQ(found->inliers, even);
  // Nothing where three are left.
  first.inliers.clear();
  for (int i = 0; i < 27; ++i) first.inliers.push_back(i);
  EXPECT_FALSE(EstimateOtherPose(measurements, first, {}, {}, 0));
}

// One that has far fewer is no rival.
TEST(EstimatePoses, NotOfFarFewerMatches) {
  auto measurements = MakeScene(30, 0, 1);
  const Pose other = Pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())), {0.5, 0, 0}};
  for (int i = 0; i < 15; ++i) {
    PoseMeasurement measurement = measurements[i];
    measurement.ray.ray = (other * (kTruth * measurement.point)).hnormalized();
    measurements.push_back(measurement);
  }
  for (const PoseEstimate& pose : EstimatePoses(measurements, 4, {}, {}, 0))
    EXPECT_LT(CenterErrorM(pose.cam_from_world, kTruth), 0.2) << pose.inliers.size();
}

// Of half of them inliers, one of log 0.01 / log(1 - 0.5^3) = 34.5 samples has them alone, with a confidence
// of 0.99.
TEST(Estimate, AsManySamplesAsTheConfidenceAsksFor) {
  EstimateOptions options{
      .confidence = 0.99, .min_num_ransac_iterations = 10, .max_num_ransac_iterations = 1000};
  const auto measurements = MakeScene(100, 100, 2);
  const auto estimate = EstimatePose(measurements, options, {}, 3);
  ASSERT_TRUE(estimate);
  const double good = std::pow(static_cast<double>(estimate->inliers.size()) / 200, 3);
  ASSERT_NEAR(good, 0.125, 0.02);  // an outlier may agree by chance
  EXPECT_EQ(estimate->num_iterations, static_cast<int>(std::log(0.01) / std::log1p(-good)));
  options.min_num_ransac_iterations = 50;
  EXPECT_EQ(EstimatePose(measurements, options, {}, 3)->num_iterations, 50);
  options = {.confidence = 0.99, .min_num_ransac_iterations = 10, .max_num_ransac_iterations = 20};
  EXPECT_EQ(EstimatePose(measurements, options, {}, 3)->num_iterations, 20);
}

// As many samples of two where up is known, of which a quarter has inliers alone: log 0.01 / log 0.75 = 16.
TEST(Estimate, FewerSamplesOfTwo) {
  const EstimateOptions options{
      .confidence = 0.99, .min_num_ransac_iterations = 5, .max_num_ransac_iterations = 1000};
  const UpMeasurement up{kTruth.rotation * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ(), 1e-3};
  const auto measurements = MakeScene(100, 100, 2);
  const auto estimate = EstimatePose(measurements, options, {}, 3, up);
  ASSERT_TRUE(estimate);
  const double good = std::pow(static_cast<double>(estimate->inliers.size()) / 200, 2);
  ASSERT_NEAR(good, 0.25, 0.03);
  EXPECT_EQ(estimate->num_iterations, static_cast<int>(std::log(0.01) / std::log1p(-good)));
  EXPECT_LT(CenterErrorM(estimate->cam_from_world, kTruth), 0.05);
}

// Two samples count as one of two and one of three where up errs by one to three times what an inlier may:
// twice as many.
TEST(Estimate, TwiceAsManySamplesWhereEveryOtherIsOfThree) {
  EstimateOptions options{.max_error_px = 6,
                          .confidence = 0.99,
                          .min_num_ransac_iterations = 5,
                          .max_num_ransac_iterations = 1000};
  // 500 px x 0.02 rad = 10 px
  const UpMeasurement up{kTruth.rotation * Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ(), 0.02};
  const auto measurements = MakeScene(100, 100, 2);
  EXPECT_FALSE(UsesTwoPoints(measurements, up, options));
  const auto estimate = EstimatePose(measurements, options, {}, 3, up);
  ASSERT_TRUE(estimate);
  const double good = std::pow(static_cast<double>(estimate->inliers.size()) / 200, 2);
  EXPECT_EQ(estimate->num_iterations, 2 * static_cast<int>(std::log(0.01) / std::log1p(-good)));
  options.max_num_ransac_iterations = 12;
  EXPECT_EQ(EstimatePose(measurements, options, {}, 3, up)->num_iterations, 12);
  // Beyond three times, all are of three: 500 x 0.04 > 18.
  options.max_num_ransac_iterations = 1000;
  const UpMeasurement rough{up.in_rig, up.in_world, 0.04};
  const auto of_three = EstimatePose(measurements, options, {}, 3, rough);
  ASSERT_TRUE(of_three);
  const double good_of_three = std::pow(static_cast<double>(of_three->inliers.size()) / 200, 3);
  EXPECT_EQ(of_three->num_iterations, static_cast<int>(std::log(0.01) / std::log1p(-good_of_three)));
}

TEST(UsesTwoPoints, WhereUpErrsByNoMoreThanAnInlierMay) {
  const auto measurements = MakeScene(1, 0, 1);  // 500 px per rad
  const UpMeasurement up{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ(), 0.0125};
  EXPECT_TRUE(UsesTwoPoints(measurements, up, {.max_error_px = 6.25}));
  EXPECT_FALSE(UsesTwoPoints(measurements, up, {.max_error_px = 6.24}));
  EXPECT_FALSE(UsesTwoPoints(measurements, std::nullopt, {}));
  EXPECT_FALSE(UsesTwoPoints({}, up, {}));
}

TEST(Estimate, EqualPointsGiveNothingOrAPoseThatFitsThem) {
  auto measurements = MakeScene(1, 0, 1);
  measurements.resize(30, measurements[0]);
  const auto estimate = EstimatePose(measurements, {}, {}, 0);
  EXPECT_TRUE(!estimate || estimate->cam_from_world.translation.allFinite());
}

}  // namespace
}  // namespace cairn
