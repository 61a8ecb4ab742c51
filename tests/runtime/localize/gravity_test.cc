// Fixes of which it is known which way is up.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/pooled.h"
#include "runtime/localize/estimate.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

// Turned by a normal error of so many degrees per axis.
Eigen::Vector3d Sensed(const Eigen::Vector3d& up, double sigma_deg, Random& random) {
  const double sigma = RadFromDeg(sigma_deg);
  const Eigen::Vector3d turn(random.Normal(0, sigma), random.Normal(0, sigma), random.Normal(0, sigma));
  return Perturb(Pose(), (Vector6d() << turn, 0, 0, 0).finished()).rotation * up;
}

Eigen::Vector3d UpAt(const Pose& cam_from_world) {
  return cam_from_world.rotation * Eigen::Vector3d::UnitZ();
}

Pose Tilted(const Pose& pose, double pitch_deg, double roll_deg) {
  Vector6d xi = Vector6d::Zero();
  xi.x() = RadFromDeg(pitch_deg);
  xi.z() = RadFromDeg(roll_deg);
  return Perturb(Pose(), xi) * pose;
}

// Points ahead of a camera, of which so many are seen where they are.
PooledVector<PoseMeasurement> MakeScene(const Pose& truth, int num_inliers, int num_outliers, double sigma_px,
                                        Random& random) {
  PooledVector<PoseMeasurement> measurements;
  for (int i = 0; i < num_inliers + num_outliers; ++i) {
    const Eigen::Vector3d in_cam(random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), random.Uniform(2, 8));
    PoseMeasurement measurement;
    measurement.point = truth.Inverse() * in_cam;
    measurement.ray.pixel_from_ray = 500 * Eigen::Matrix2d::Identity();
    measurement.ray.ray = in_cam.hnormalized() +
                          Eigen::Vector2d(random.Normal(0, sigma_px / 500), random.Normal(0, sigma_px / 500));
    measurement.ray.sigma_px = sigma_px;
    if (i >= num_inliers) measurement.ray.ray = {random.Uniform(-0.6, 0.6), random.Uniform(-0.5, 0.5)};
    measurements.push_back(measurement);
  }
  return measurements;
}

UpMeasurement UpOf(const Pose& truth, double sigma_deg) {
  return {UpAt(truth), Eigen::Vector3d::UnitZ(), RadFromDeg(sigma_deg)};
}

TEST(Gravity, TwoPointsFindWhatThreeDoNotInAsManySamples) {
  Random random(1);
  EstimateOptions options;
  options.max_num_ransac_iterations = 1500;  // 0.05^2 asks for 3700, 0.05^3 for 74000
  int num_with = 0, num_without = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Pose truth = Tilted(PoseAt({1, 2, 1}, 20.0 * trial), 10, -5);
    const auto measurements = MakeScene(truth, 20, 380, 1, random);
    const UpMeasurement up = UpOf(truth, 0.3);
    ASSERT_TRUE(UsesTwoPoints(measurements, up, options));
    const auto is_right = [&](const std::optional<PoseEstimate>& estimate) {
      return estimate && CenterErrorM(estimate->cam_from_world, truth) < 0.15;
    };
    num_with += is_right(EstimatePose(measurements, options, {}, trial, up)) ? 1 : 0;
    num_without += is_right(EstimatePose(measurements, options, {}, trial)) ? 1 : 0;
  }
  EXPECT_GE(num_with, 18);
  EXPECT_LE(num_without, num_with - 8);
}

TEST(Gravity, WhereAllAgreeFewerSamplesAreAskedFor) {
  Random random(2);
  const Pose truth = PoseAt({1, 2, 1}, 30);
  const auto measurements = MakeScene(truth, 60, 60, 1, random);
  EstimateOptions options;
  options.min_num_ransac_iterations = 1;
  const auto with = EstimatePose(measurements, options, {}, 0, UpOf(truth, 0.3)),
             without = EstimatePose(measurements, options, {}, 0);
  ASSERT_TRUE(with && without);
  EXPECT_LE(with->num_iterations, 35);     // log(1e-4) / log(1 - 1/4) = 32 where all inliers are found
  EXPECT_GE(without->num_iterations, 60);  // log(1e-4) / log(1 - 1/8) = 69
}

TEST(Gravity, WhenItIsUncertainThreePointsGiveUprightPosesOnly) {
  Random random(3);
  const Pose truth = PoseAt({0, 0, 1}, 70), tilted = Tilted(truth, 40, 0);
  const EstimateOptions options;
  // More points agree on the tilted pose.
  auto measurements = MakeScene(truth, 30, 0, 1, random);
  for (const PoseMeasurement& measurement : MakeScene(tilted, 40, 0, 1, random))
    measurements.push_back(measurement);
  const UpMeasurement up = UpOf(truth, 6);
  EXPECT_FALSE(UsesTwoPoints(measurements, up, options));
  const auto upright = EstimatePose(measurements, options, {}, 0, up),
             any = EstimatePose(measurements, options, {}, 0);
  ASSERT_TRUE(upright && any);
  EXPECT_LT(CenterErrorM(upright->cam_from_world, truth), 0.1);
  EXPECT_LT(CenterErrorM(any->cam_from_world, tilted), 0.1);
  EXPECT_FALSE(UsesTwoPoints(measurements, std::nullopt, options));
  EXPECT_FALSE(UsesTwoPoints({}, up, options));
}

TEST(Gravity, ErrorInSigmasIsTheAngleOverItsSigma) {
  const Pose truth = PoseAt({0, 0, 1}, 70);
  const UpMeasurement up = UpOf(truth, 2);
  EXPECT_NEAR(UpErrorInSigmas(up, truth), 0, 1e-9);
  EXPECT_NEAR(UpErrorInSigmas(up, Tilted(truth, 3, 0)), 1.5, 1e-9);
  EXPECT_NEAR(UpErrorInSigmas(up, Tilted(truth, 0, 170)), 85, 1e-6);
}

TEST(Gravity, CovarianceKnowsIt) {
  // Few points, badly measured, and an up that is known better than they tell: 6 degrees of freedom.
  Random random(4);
  double sum = 0, tilt_with = 0, tilt_without = 0;
  constexpr int kNumTrials = 400;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Pose truth = Tilted(PoseAt({0, 0, 1}, random.Uniform(0, 360)), 10, 5);
    const auto measurements = MakeScene(truth, 40, 0, 8, random);
    UpMeasurement up = UpOf(truth, 0.3);
    up.in_rig = Sensed(up.in_rig, 0.3, random);
    RefineOptions options;
    options.inlier_chi_square = 100;
    const auto with = RefinePoseWithCovariance(measurements, truth, options, up),
               without = RefinePoseWithCovariance(measurements, truth, options);
    ASSERT_TRUE(with && without);
    const Vector6d error = PerturbationBetween(with->cam_from_world, truth);
    sum += error.dot(with->covariance.inverse() * error);
    tilt_with += (UpAt(with->cam_from_world) - UpAt(truth)).squaredNorm();
    tilt_without += (UpAt(without->cam_from_world) - UpAt(truth)).squaredNorm();
    EXPECT_LT(with->covariance.trace(), without->covariance.trace() * 1.2);
  }
  EXPECT_NEAR(sum / kNumTrials, 6, 4 * std::sqrt(12.0 / kNumTrials));
  EXPECT_LT(std::sqrt(tilt_with), 0.6 * std::sqrt(tilt_without));
}

TEST(Gravity, LocalizersTakeItAndRefuseWhatItContradicts) {
  LocalizerOptions options;
  options.accept.min_probability = 0;  // most of what should be seen is missing
  Localizer localizer(RoomMap(), options);
  Random random(5);
  int num_with = 0, num_without = 0;
  constexpr int kNumTrials = 40;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Pose truth = Tilted(RandomPose(random), random.Uniform(-10, 10), random.Uniform(-10, 10));
    const RenderOptions few{.detection_ratio = 0.05, .num_outliers = 300};
    const Features features = RenderFeatures(Room(), truth, few, 100 + trial);
    const SensedUp up{7 * Sensed(UpAt(truth), 0.5, random), 0.5};  // of any length
    const Localization with = *localizer.LocalizeFeatures(features, Room().camera, std::nullopt, up),
                       without = *localizer.LocalizeFeatures(features, Room().camera);
    for (const Localization& found : {with, without})
      EXPECT_TRUE(!found.has_fix() || CenterErrorM(found.cam_from_world, truth) < 0.3) << trial;
    num_with += with.has_fix() ? 1 : 0;
    num_without += without.has_fix() ? 1 : 0;
    if (!without.has_fix()) continue;
    const SensedUp wrong{Tilted(truth, 30, 0).rotation * Eigen::Vector3d::UnitZ(), 0.5};
    const Localization misled = *localizer.LocalizeFeatures(features, Room().camera, std::nullopt, wrong);
    EXPECT_TRUE(!misled.has_fix() || misled.probability < 0.01) << trial;
  }
  EXPECT_GE(num_with, num_without);
  EXPECT_GE(num_without, kNumTrials / 2);
}

TEST(Gravity, AFixThatTiltsTheCameraSaysSo) {
  // Its first pose comes without: only the judgement is left.
  LocalizerOptions options;
  options.floor_up_sigma_deg = 5;  // three points, upright within four sigmas
  options.accept.max_up_sigmas = 1;
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  const SensedUp ten_deg_off{Tilted(truth, 10, 0).rotation * Eigen::Vector3d::UnitZ(), 1};
  const Localization found =
      *Localizer(RoomMap(), options).LocalizeFeatures(features, Room().camera, std::nullopt, ten_deg_off);
  EXPECT_EQ(found.reason, NoFix::kTilted) << found.message;
  EXPECT_STREQ(NoFixName(found.reason), "tilted");
  EXPECT_THAT(found.message, testing::HasSubstr("at most 5.1 are allowed"));
  options.accept.max_up_sigmas = 4;
  EXPECT_TRUE(Localizer(RoomMap(), options)
                  .LocalizeFeatures(features, Room().camera, std::nullopt, ten_deg_off)
                  ->has_fix());
}

TEST(Gravity, WhereTheFloorLeansMoreSigmasMayBeAllowed) {
  LocalizerOptions options;
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  const Features features = RenderFeatures(Room(), truth, {}, 3);
  const SensedUp far_off{Tilted(truth, 14, 0).rotation * Eigen::Vector3d::UnitZ(), 1};
  options.accept.min_probability = 0;
  const Localization none =
      *Localizer(RoomMap(), options).LocalizeFeatures(features, Room().camera, std::nullopt, far_off);
  EXPECT_FALSE(none.has_fix());
  EXPECT_THAT(none.message, testing::HasSubstr("sensed"));
  options.accept.max_up_sigmas = 10;
  const Localization found =
      *Localizer(RoomMap(), options).LocalizeFeatures(features, Room().camera, std::nullopt, far_off);
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, truth), 0.1);
}

TEST(Gravity, IsOfAFramesFeaturesThatAreKnownByThen) {
  const Localizer localizer(RoomMap());
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  QueryFrame frame(localizer, RenderFeatures(Room(), truth, {}, 3), Room().camera);
  EXPECT_FALSE((*frame.WithAllFeatures())->up);
  frame.set_up({UpAt(truth), 1});
  ASSERT_TRUE((*frame.WithAllFeatures())->up);
  EXPECT_LT(((*frame.WithAllFeatures())->up->in_rig - UpAt(truth)).norm(), 1e-9);
}

TEST(Gravity, IsOfTheGivenCamerasFrame) {
  MapRows rows = Room().rows;
  rows.camera_from_given.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 2, 3).normalized()));
  const auto map = *Map::FromRows(rows);
  const Pose truth = PoseAt({0.4, 0.3, 1.2}, 20);
  const Pose given = rows.camera_from_given.Inverse() * truth;
  const auto found = *Localizer(map).LocalizeFeatures(RenderFeatures(Room(), truth, {}, 3), Room().camera,
                                                      std::nullopt, SensedUp{UpAt(given), 1});
  ASSERT_TRUE(found.has_fix()) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, given), 0.05);
}

TEST(Gravity, WhatIsNoDirectionIsRefused) {
  Localizer localizer(RoomMap());
  const Features features = RenderFeatures(Room(), PoseAt({0, 0, 1}, 0), {}, 3);
  for (const SensedUp& up :
       {SensedUp{{0, 0, 0}, 1}, SensedUp{{0, std::nan(""), 1}, 1}, SensedUp{{0, 0, 1}, 0},
        SensedUp{{0, 0, 1}, INFINITY}, SensedUp{{0, 0, 1}, -1}}) {
    const auto found = localizer.LocalizeFeatures(features, Room().camera, std::nullopt, up);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(found.error().message, testing::HasSubstr("gravity"));
  }
}

}  // namespace
}  // namespace cairn
