#include "core/promise/pose_information.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "core/base/random.h"

namespace cairn {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

Eigen::Vector3d Bearing(const Pose& pose, const Eigen::Vector3d& point) {
  return (pose * point).normalized();
}

// Left perturbation: rotation, then translation.
Pose Perturbed(const Pose& pose, const Eigen::Matrix<double, 6, 1>& by) {
  const Eigen::Vector3d turn = by.head<3>();
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(turn.norm(), turn.norm() > 0 ? turn.normalized() : Eigen::Vector3d::UnitX().eval()));
  return Pose{rotation, by.tail<3>()} * pose;
}

TEST(InformationRoot, IsTheBearingsDerivativeOverItsError) {
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized())),
                  {0.2, -0.1, 0.5}};
  FeatureClass row;
  row.position = {0.5, 0.3, 3};
  const double sigma = 0.01, probability = 0.3;
  const auto root = InformationRoot(row, pose, sigma, probability);
  ASSERT_TRUE(root.has_value());
  Eigen::Matrix<double, 3, 6> derivative;
  for (int i = 0; i < 6; ++i) {
    Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
    step[i] = 1e-6;
    derivative.col(i) =
        (Bearing(Perturbed(pose, step), row.position) - Bearing(Perturbed(pose, -step), row.position)) / 2e-6;
  }
  const Matrix6d expected = probability * derivative.transpose() * derivative / (sigma * sigma);
  EXPECT_LT((root->transpose() * *root - expected).norm(), 1e-5 * expected.norm());
}

// In the direction in which the landmark's place is uncertain its bearing says less: as if the error were
// hypot(sigma, sigma of the place over the distance).
TEST(InformationRoot, UncertainPlacesSayLess) {
  FeatureClass row;
  row.position = {0, 0, 2};
  row.covariance = Eigen::Vector3d(0.04, 0, 0.09).asDiagonal();  // 0.2 m across: 0.1 rad; along: no matter
  const auto root = InformationRoot(row, {}, 0.05, 1);
  const Matrix6d information = root->transpose() * *root;
  EXPECT_NEAR(information(3, 3), 1 / (4 * (0.05 * 0.05 + 0.1 * 0.1)), 1e-9);
  EXPECT_NEAR(information(4, 4), 1 / (4 * 0.05 * 0.05), 1e-9);
  EXPECT_NEAR(information(5, 5), 0, 1e-9);
}

TEST(InformationRoot, LandmarkAtTheCamerasCentreHasNone) {
  FeatureClass row;
  row.position = {1, 2, 3};
  EXPECT_FALSE(InformationRoot(row, Pose{Eigen::Quaterniond::Identity(), {-1, -2, -3}}, 0.01, 1).has_value());
  EXPECT_TRUE(
      InformationRoot(row, Pose{Eigen::Quaterniond::Identity(), {-1, -2, -2.999}}, 0.01, 1).has_value());
}

// Gains against determinants and traces of matrices that are inverted from scratch.
TEST(PoseInformation, GainsAreThoseOfTheMatrices) {
  Random random(11);
  PoseInformation information(2, 0.5, 20);
  Matrix6d matrices[2] = {Matrix6d::Zero(), Matrix6d::Zero()};
  for (Matrix6d& matrix : matrices) {
    for (int i = 0; i < 3; ++i) {
      matrix(i, i) = 1 / (RadFromDeg(20) * RadFromDeg(20));
      matrix(i + 3, i + 3) = 4;
    }
  }
  const auto trace = [](const Matrix6d& matrix) {
    return matrix.inverse().eval().bottomRightCorner<3, 3>().trace();
  };
  for (int step = 0; step < 12; ++step) {
    std::vector<SightInformation> sights;
    double determinant_gain = 0;
    for (size_t view = 0; view < 2; ++view) {
      if (step % 3 == static_cast<int>(view)) continue;
      FeatureClass row;
      row.position = {2 * random.Uniform() - 1, 2 * random.Uniform() - 1, 1 + 3 * random.Uniform()};
      const auto root = InformationRoot(row, {}, 0.02, 0.1 + 0.9 * random.Uniform());
      sights.push_back({view, *root});
      const Matrix6d more = matrices[view] + root->transpose() * *root;
      determinant_gain += std::log(more.determinant() / matrices[view].determinant());
      EXPECT_NEAR(information.PlaceRatio(view, *root), trace(more) / trace(matrices[view]), 1e-8);
      matrices[view] = more;
    }
    EXPECT_NEAR(information.DeterminantGain(sights), determinant_gain, 1e-7);
    information.Add(sights);
  }
}

TEST(PoseInformation, WhatSaysNothingGainsNothing) {
  PoseInformation information(1, 1, 30);
  const SightInformation none{0, Eigen::Matrix<double, 2, 6>::Zero()};
  EXPECT_EQ(information.PlaceRatio(0, none.root), 1);
  EXPECT_EQ(information.DeterminantGain({none}), 0);
}

}  // namespace
}  // namespace cairn
