#include "stages/group_classes/adjust/bundle.h"

#include <memory>
#include <utility>
#include <vector>

#include <ceres/ceres.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "core/base/random.h"
#include "stages/group_classes/adjust/evidence.h"
#include "tests/group_classes/circle.h"

namespace cairn::group_classes {
namespace {

// The estimate is as far off as its standard deviation says, at any noise: without the growth of residuals
// a focal length comes out too long, by more the larger the noise is.
TEST(AdjustBundle, FocalLengthIsNotFoundTooLong) {
  const Camera camera = Lens();
  for (const double noise_px : {0.3, 1.5}) {
    double sum = 0;
    Circle circle = MakeCircle(camera, camera, noise_px, {0, 1});
    BundleEvidence evidence;
    EXPECT_TRUE(AdjustBundle({}, &circle.problem, &evidence));
    ASSERT_EQ(evidence.camera_sigma.size(), 1u);
    for (int p = 0; p < 2; ++p) {
      EXPECT_LT(std::abs(circle.problem.cameras[0].delta[p]), 3 * evidence.camera_sigma[0][p]) << noise_px;
      sum += evidence.camera_sigma[0][p];
    }
    EXPECT_LT(sum, 20 * noise_px);  // and that is not vacuous
  }
}

TEST(AdjustBundle, MovedPosesAndPointsReturn) {
  const Camera camera = Lens();
  Circle circle = MakeCircle(camera, camera, 0.1, {});
  Random random(8);
  circle.problem.noise = {0.05, 2, 0.05, 2};
  for (size_t i = 1; i < circle.poses.size(); ++i) {
    Pose& pose = circle.problem.images[i].cam_from_world;
    pose.translation += 0.02 * Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
    pose.rotation = (Eigen::AngleAxisd(0.01 * random.Normal(0, 1), Eigen::Vector3d::UnitX()) * pose.rotation)
                        .normalized();
  }
  for (Eigen::Vector3d& point : circle.problem.points)
    point += 0.02 * Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
  EXPECT_TRUE(AdjustBundle({}, &circle.problem, nullptr));
  for (size_t i = 0; i < circle.poses.size(); ++i) {
    // The frame of all may move.
    const Pose found =
        circle.problem.images[i].cam_from_world * circle.problem.images[0].cam_from_world.Inverse();
    const Pose truth = circle.poses[i] * circle.poses[0].Inverse();
    EXPECT_LT(CenterErrorM(found, truth), 0.01);
    EXPECT_LT(RotationErrorDeg(found, truth), 0.05);
  }
}

// Every second pose is fixed where it is right; the others, from which they are stated to be a step away, and
// the points return to them, without the frame of all.
TEST(AdjustBundle, FixedPosesStayToTheBitAndOthersReturnToThem) {
  const Camera camera = Lens();
  Circle circle = MakeCircle(camera, camera, 0.1, {});
  Random random(8);
  circle.problem.noise = {0.05, 2, 0.05, 2};
  for (size_t i = 0; i < circle.poses.size(); ++i) {
    BundleProblem::Image& image = circle.problem.images[i];
    image.is_fixed = i % 2 == 1;
    if (image.is_fixed) continue;
    image.cam_from_world.translation +=
        0.02 * Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
    image.drifted.translation.x() += 0.01;
  }
  EXPECT_TRUE(AdjustBundle({}, &circle.problem, nullptr));
  for (size_t i = 0; i < circle.poses.size(); ++i) {
    const BundleProblem::Image& image = circle.problem.images[i];
    EXPECT_LT(CenterErrorM(image.cam_from_world, circle.poses[i]), 0.002) << i;
    if (i % 2 == 1) {
      EXPECT_EQ(image.cam_from_world.translation, circle.poses[i].translation);
      EXPECT_EQ(image.cam_from_world.rotation.coeffs(), circle.poses[i].rotation.coeffs());
      EXPECT_EQ(image.drifted.translation, circle.poses[i].translation);
    } else {  // its drifted pose is pulled by the fixed ones before and after it
      EXPECT_LT(CenterErrorM(image.drifted, circle.poses[i]), 0.003) << i;
    }
  }
}

// Points that lie far off, along their rays or not, are placed by the poses of a step before it is judged:
// after one step they are where these poses see them.  By a step alone they are not, as it is linear.
TEST(AdjustBundle, PointsFollowTheStepOfThePoses) {
  const Camera camera = Lens();
  const auto root_mean_square_px = [&](bool points_follow) {
    Circle circle = MakeCircle(camera, camera, 0.1, {});
    Random random(9);
    for (Eigen::Vector3d& point : circle.problem.points)
      point += 0.5 * Eigen::Vector3d(random.Normal(0, 1), random.Normal(0, 1), random.Normal(0, 1));
    AdjustBundle({.max_num_iterations = 1, .points_follow = points_follow}, &circle.problem, nullptr);
    double sum = 0;
    for (const BundleProblem::Observation& observation : circle.problem.observations)
      sum += ResidualOf(circle.problem, observation).squaredNorm();
    return std::sqrt(sum / static_cast<double>(circle.problem.observations.size()));
  };
  EXPECT_LT(root_mean_square_px(true), 0.3);
  EXPECT_GT(root_mean_square_px(false), 1);
}

TEST(AdjustBundle, EvidenceCountsWhatKeypointsDetermine) {
  const Camera camera = Lens();
  for (const auto& [own, is_determined] : {std::pair(0.5, true), std::pair(1e-7, false)}) {
    Circle circle = MakeCircle(camera, camera, 0.5, {});
    circle.problem.noise = {own, own * 50, 1e-7, 1e-6};
    BundleEvidence evidence;
    AdjustBundle({}, &circle.problem, &evidence);
    EXPECT_EQ(evidence.own_m.num_residuals, 36);
    EXPECT_EQ(evidence.walk_deg.num_residuals, 33);
    if (is_determined) {
      EXPECT_GT(evidence.own_m.num_determined, 25);
      EXPECT_LT(evidence.own_m.sum_of_squares, 1);
    } else {
      EXPECT_LT(evidence.own_m.num_determined, 0.1);
    }
    EXPECT_LT(evidence.walk_m.num_determined, 0.1);
  }
}

// One row, of a point where it has one, and of three other parameters in two blocks.
class LinearCost : public ceres::CostFunction {
 public:
  LinearCost(bool has_point, std::vector<double> row) : row_(std::move(row)) {
    set_num_residuals(1);
    if (has_point) mutable_parameter_block_sizes()->push_back(3);
    for (const int size : {1, 2}) mutable_parameter_block_sizes()->push_back(size);
  }
  bool Evaluate(double const* const* parameters, double* residual, double** jacobians) const override {
    residual[0] = 1;
    for (size_t b = 0, k = 0; b < parameter_block_sizes().size(); ++b) {
      for (int i = 0; i < parameter_block_sizes()[b]; ++i, ++k) {
        residual[0] += parameters[b][i] * row_[k];
        if (jacobians != nullptr && jacobians[b] != nullptr) jacobians[b][i] = row_[k];
      }
    }
    return true;
  }

 private:
  std::vector<double> row_;
};

TEST(ReducedSystem, TracesAndCovariancesAreThoseOfTheWholeSystem) {
  // Two points, three other parameters; rows of the others alone, then rows of keypoints.
  Random random(2);
  constexpr int kRows = 24, kColumns = 9;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kRows, kColumns);
  std::vector<double> values(kColumns, 0);
  std::vector<std::unique_ptr<LinearCost>> costs;
  SchurProblem problem;
  for (const int point : {0, 1}) problem.AddPoint(&values[3 * point]);
  const int first = problem.AddBlock(&values[6], 1), second = problem.AddBlock(&values[7], 2);
  for (int row = 0; row < kRows; ++row) {
    const bool has_point = row >= 4;
    const int point = row % 2;
    for (int c = 6; c < kColumns; ++c) dense(row, c) = random.Normal(0, 1);
    for (int c = 0; c < 3 && has_point; ++c) dense(row, 3 * point + c) = random.Normal(0, 1);
    std::vector<double> of_row;
    for (int c = has_point ? 3 * point : 3 * point + 3; c < 3 * point + 3; ++c)
      of_row.push_back(dense(row, c));
    for (int c = 6; c < kColumns; ++c) of_row.push_back(dense(row, c));
    costs.push_back(std::make_unique<LinearCost>(has_point, std::move(of_row)));
    if (has_point) {
      problem.AddResidual(costs.back().get(), nullptr, {point, first, second});
    } else {
      problem.AddResidual(costs.back().get(), nullptr, {first, second});
    }
  }
  const ReducedSystem system(problem, 2);
  ASSERT_TRUE(system.ok());
  const Eigen::MatrixXd covariance = (dense.transpose() * dense).inverse();
  EXPECT_LT((system.Covariance(first) - covariance.block<1, 1>(6, 6)).norm(), 1e-6 * covariance.norm());
  EXPECT_LT((system.Covariance(second) - covariance.block<2, 2>(7, 7)).norm(), 1e-6 * covariance.norm());
  const Eigen::MatrixXd rows = dense.topRows(4);
  const auto trace = [&](std::vector<ReducedSystem::Row> of) { return system.Trace(of); };
  EXPECT_NEAR(trace({{0, 0}, {1, 0}, {2, 0}, {3, 0}}), (rows * covariance * rows.transpose()).trace(), 0.25);
  EXPECT_NEAR(trace({{2, 0}}), (rows.row(2) * covariance * rows.row(2).transpose())(0, 0), 1e-6);
  EXPECT_EQ(system.ValueOf({5, 0}), 1);
}

// A point that nothing sees, one of one ray, and one of two rays that are the same: their places along the
// rays are not determined, but what the others determine is.
TEST(ReducedSystem, WhatNothingDeterminesIsNoError) {
  std::vector<double> points(9, 0), values(2, 0);
  SchurProblem problem;
  for (const int point : {0, 1, 2}) problem.AddPoint(&points[3 * point]);
  double seen = 0, partly[2] = {0, 0};
  const int first = problem.AddBlock(&seen, 1), second = problem.AddBlock(partly, 2);
  const LinearCost alone(false, {1, 0, 2}), across(true, {1, 0, 0, 1, 0, 0}), down(true, {0, 1, 0, 0, 1, 0});
  problem.AddResidual(&alone, nullptr, {first, second});
  for (const int point : {1, 2, 2}) {
    problem.AddResidual(&across, nullptr, {point, first, second});
    problem.AddResidual(&down, nullptr, {point, first, second});
  }
  const int unseen = problem.AddBlock(values.data(), 2);
  const ReducedSystem system(problem, 1);
  ASSERT_TRUE(system.ok());
  EXPECT_GE(system.Covariance(unseen).trace(), 1);
  EXPECT_NEAR(system.Trace(std::vector<ReducedSystem::Row>{{0, 0}}), 1, 1e-6);
  EXPECT_GT(system.Covariance(second)(0, 0), 1e6);
}

}  // namespace
}  // namespace cairn::group_classes
