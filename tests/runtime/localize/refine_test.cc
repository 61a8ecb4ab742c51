#include "runtime/localize/refine.h"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "core/base/pooled.h"
#include "core/base/random.h"

namespace cairn {
namespace {

// The errors made here are independent of each other: no factor for those that are not.
const RefineOptions kIndependent{.covariance_scale = 1};

// Points in front of a camera with focal length 500 px, seen with noise of sigma_px and, in part, wrongly.
PooledVector<PoseMeasurement> MakeScene(const Pose& truth, int num_points, double sigma_px,
                                        double outlier_ratio, Random& random) {
  PooledVector<PoseMeasurement> measurements;
  while (static_cast<int>(measurements.size()) < num_points) {
    const Eigen::Vector3d in_cam(random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), random.Uniform(2, 8));
    PoseMeasurement measurement;
    measurement.point = truth.Inverse() * in_cam;
    measurement.ray.pixel_from_ray = 500 * Eigen::Matrix2d::Identity();
    measurement.ray.sigma_px = sigma_px;
    measurement.ray.ray = in_cam.hnormalized();
    const double sigma = random.Uniform() < outlier_ratio ? 40 : sigma_px;
    measurement.ray.ray += Eigen::Vector2d(random.Normal(0, sigma / 500), random.Normal(0, sigma / 500));
    measurements.push_back(measurement);
  }
  return measurements;
}

Pose Truth() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized())), {1, 2, -3}};
}

Pose Disturbed() { return Perturb(Truth(), (Vector6d() << 0.02, -0.03, 0.01, 0.1, -0.05, 0.08).finished()); }

TEST(Refine, PerturbationAndItsInverse) {
  const Vector6d xi = (Vector6d() << 0.3, -0.2, 0.5, 1, 2, 3).finished();
  EXPECT_LT((PerturbationBetween(Truth(), Perturb(Truth(), xi)) - xi).norm(), 1e-12);
}

TEST(Refine, CleanMeasurementsGiveTheTruth) {
  Random random(1);
  auto measurements = MakeScene(Truth(), 20, 0, 0, random);
  for (PoseMeasurement& measurement : measurements) measurement.ray.sigma_px = 1;
  const auto pose = RefinePose(measurements, Disturbed(), kIndependent);
  ASSERT_TRUE(pose);
  EXPECT_LT(PerturbationBetween(*pose, Truth()).norm(), 1e-8);
}

TEST(Refine, WhatIsNotKnownOfTheMotionWhileRowsAreReadIsInTheCovariance) {
  Random random(12);
  Vector6d sigmas;
  sigmas << 0.01, 0.02, 0.005, 0.02, 0.01, 0.04;
  double sum = 0, sum_without = 0;
  constexpr int kNumTrials = 300;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    Vector6d motion;
    for (int i = 0; i < 6; ++i) motion[i] = random.Normal(0, sigmas[i]);
    auto measurements = MakeScene(Truth(), 60, 0.5, 0, random);
    for (PoseMeasurement& measurement : measurements) {
      // The row is as good as where the point is without the motion.
      const double part = measurement.ray.ray.y();
      const Pose moved = Perturb(Truth(), part * motion);
      measurement.ray.ray +=
          (moved * measurement.point).hnormalized() - (Truth() * measurement.point).hnormalized();
      measurement.row = {part, sigmas};
    }
    RefineOptions options = kIndependent;
    options.inlier_chi_square = 1e4;  // motions are larger than the noise
    const auto refined = RefinePoseWithCovariance(measurements, Truth(), options);
    ASSERT_TRUE(refined);
    const Vector6d error = PerturbationBetween(refined->cam_from_world, Truth());
    sum += error.dot(refined->covariance.inverse() * error);
    for (PoseMeasurement& measurement : measurements) measurement.row.reset();
    const auto without = RefinePoseWithCovariance(measurements, Truth(), options);
    sum_without += error.dot(without->covariance.inverse() * error);
  }
  EXPECT_GT(sum_without / kNumTrials, 10);
  EXPECT_LT(sum / kNumTrials, 7);
  EXPECT_GT(sum / kNumTrials, 3);  // the noise that is found has a part of the motion, too
}

TEST(Refine, KeypointsErrTogetherWithThoseOfTheirImageAlone) {
  Random random(4);
  auto measurements = MakeScene(Truth(), 80, 0.5, 0, random);
  RefineOptions options = kIndependent;
  options.inlier_chi_square = 100;
  options.keypoint_correlation = 0.1;
  const auto of_one = RefinePoseWithCovariance(measurements, Disturbed(), options);
  for (size_t i = 0; i < measurements.size(); ++i) measurements[i].image = i < 40 ? 0 : 1;
  const auto of_two = RefinePoseWithCovariance(measurements, Disturbed(), options);
  ASSERT_TRUE(of_one && of_two);
  EXPECT_NEAR(of_one->covariance.trace() / of_two->covariance.trace(), (1 + 4.0) / (1 + 2.0), 1e-9);
}

TEST(Refine, OfOneCameraOfARigThePoseIsTheRigs) {
  Random random(3);
  const Pose cam_from_rig = Perturb(Pose(), (Vector6d() << 0.5, -1, 0.3, 0.2, -0.4, 0.6).finished());
  auto measurements = MakeScene(cam_from_rig * Truth(), 20, 0, 0, random);
  for (PoseMeasurement& measurement : measurements) {
    measurement.ray.sigma_px = 1;
    measurement.cam_from_rig = cam_from_rig;
  }
  const auto pose = RefinePose(measurements, Disturbed(), kIndependent);
  ASSERT_TRUE(pose);
  EXPECT_LT(PerturbationBetween(*pose, Truth()).norm(), 1e-8);
}

TEST(PixelOf, IsWhereTheRowThatIsReadThenSeesThePoint) {
  Query query;
  query.camera.model = CameraModel::kSimplePinhole;
  query.camera.width = 640;
  query.camera.height = 480;
  query.camera.params = {500, 320, 240};
  const Eigen::Vector3d point(0.5, -0.8, 3);
  EXPECT_EQ(*PixelOf(query, point), *ImageFromCamera(query.camera, point));
  query.readout.motion << 0.02, -0.03, 0.01, 0.05, 0, -0.1;
  const Eigen::Vector2d pixel = *PixelOf(query, point);
  const Pose at_row = Perturb(Pose(), (pixel.y() / 480 - 0.5) * query.readout.motion);
  EXPECT_LT((*ImageFromCamera(query.camera, at_row * point) - pixel).norm(), 0.05);
  EXPECT_GT((*ImageFromCamera(query.camera, point) - pixel).norm(), 3);
  EXPECT_FALSE(PixelOf(query, {0, 0, -1}));
}

TEST(Refine, OutliersAreLeftOut) {
  Random random(2);
  const auto measurements = MakeScene(Truth(), 100, 0.5, 0.2, random);
  const auto refined = RefinePoseWithCovariance(measurements, Disturbed(), kIndependent);
  ASSERT_TRUE(refined);
  EXPECT_LT(CenterErrorM(refined->cam_from_world, Truth()), 0.02);
  EXPECT_LT(refined->inliers.size(), 90u);
  EXPECT_GT(refined->inliers.size(), 70u);
}

TEST(Refine, NormalisedErrorSquaredHasMeanSix) {
  for (const int num_points : {12, 30, 200}) {
    for (const double claimed : {0.3, 1.0, 2.0}) {  // the real noise is 1 px, whatever the measurements claim
      Random random(3);
      double sum = 0;
      int count = 0;
      for (int i = 0; i < 600; ++i) {
        auto measurements = MakeScene(Truth(), num_points, 1, 0, random);
        for (PoseMeasurement& measurement : measurements) measurement.ray.sigma_px = claimed;
        const auto refined = RefinePoseWithCovariance(measurements, Disturbed(), kIndependent);
        if (!refined) continue;
        const Vector6d error = PerturbationBetween(refined->cam_from_world, Truth());
        sum += error.dot(refined->covariance.inverse() * error);
        ++count;
      }
      EXPECT_GT(count, 570);
      // Few points: the noise is known from few residuals, so the error's distribution has a heavier tail.
      EXPECT_NEAR(sum / count, 6, num_points == 12 ? 1.5 : 0.45)
          << num_points << " points, claimed " << claimed;
    }
  }
}

// Of n inliers, 2 n residuals for 6 parameters, and 2 less for a mean of the errors' squares.
TEST(Refine, TheNoiseIsThatOfTheInliersResiduals) {
  Random random(7);
  auto measurements = MakeScene(Truth(), 12, 0.4, 0, random);
  for (PoseMeasurement& measurement : measurements) measurement.ray.sigma_px = 2;
  RefineOptions options = kIndependent;
  options.inlier_chi_square = 1e3;  // nothing is cut off
  const auto refined = RefinePoseWithCovariance(measurements, Disturbed(), options);
  ASSERT_TRUE(refined);
  ASSERT_EQ(refined->inliers.size(), measurements.size());
  double sum = 0;
  for (const PoseMeasurement& measurement : measurements) {
    const Eigen::Vector2d off =
        (refined->cam_from_world * measurement.point).hnormalized() - measurement.ray.ray;
    sum += (500 * off / 2).squaredNorm();
  }
  EXPECT_NEAR(refined->noise_variance, sum / (2 * 12 - 6 - 2), 1e-9);
}

TEST(Refine, LandmarkCovarianceWeighsAndCounts) {
  // Half of the landmarks are off by 5 cm and say so.
  Random random(4);
  double sum = 0;
  for (int i = 0; i < 300; ++i) {
    auto measurements = MakeScene(Truth(), 60, 0.5, 0, random);
    for (size_t k = 0; k < measurements.size(); k += 2) {
      measurements[k].point_covariance = 0.05 * 0.05 * Eigen::Matrix3d::Identity();
      for (int axis = 0; axis < 3; ++axis) measurements[k].point[axis] += random.Normal(0, 0.05);
    }
    const auto refined = RefinePoseWithCovariance(measurements, Disturbed(), kIndependent);
    ASSERT_TRUE(refined);
    const Vector6d error = PerturbationBetween(refined->cam_from_world, Truth());
    sum += error.dot(refined->covariance.inverse() * error);
  }
  EXPECT_NEAR(sum / 300, 6, 1.96 * std::sqrt(12.0 / 300));
}

TEST(Refine, TransformedCovarianceFitsTransformedErrors) {
  // Oracle: perturbations drawn from C, carried through the frame change one by one.
  Random random(5);
  const Pose change{Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.2, 1, -0.4).normalized())),
                    {0.5, 2, -1}};
  Matrix6d factor;
  for (int i = 0; i < 36; ++i) factor(i) = random.Normal(0, 1e-3);
  const Matrix6d covariance = factor * factor.transpose();
  Matrix6d sampled = Matrix6d::Zero();
  constexpr int kNumSamples = 20000;
  for (int i = 0; i < kNumSamples; ++i) {
    Vector6d unit;
    for (int k = 0; k < 6; ++k) unit[k] = random.Normal(0, 1);
    const Vector6d moved = PerturbationBetween(change * Truth(), change * Perturb(Truth(), factor * unit));
    sampled += moved * moved.transpose() / kNumSamples;
  }
  const Matrix6d expected = TransformCovariance(change, covariance);
  EXPECT_LT((sampled - expected).norm(), 0.05 * expected.norm());
}

TEST(Refine, TooFewOrDegeneratePointsGiveNothing) {
  Random random(6);
  EXPECT_FALSE(RefinePoseWithCovariance(MakeScene(Truth(), 3, 1, 0, random), Disturbed(), {}));
  auto same = MakeScene(Truth(), 1, 1, 0, random);
  same.resize(20, same[0]);  // one point twenty times
  const auto refined = RefinePoseWithCovariance(same, Disturbed(), kIndependent);
  EXPECT_TRUE(!refined || std::sqrt(refined->covariance.diagonal().maxCoeff()) > 10);
}

}  // namespace
}  // namespace cairn
