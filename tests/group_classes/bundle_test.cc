#include "stages/group_classes/adjust/bundle.h"

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

TEST(ReducedSystem, TracesAndCovariancesAreThoseOfTheWholeSystem) {
  // Two points, three other parameters; rows of keypoints, then rows of the others alone.
  Random random(2);
  constexpr int kRows = 24, kColumns = 9;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kRows, kColumns);
  for (int row = 0; row < kRows; ++row) {
    const bool has_point = row >= 4;
    for (int c = 6; c < kColumns; ++c) dense(row, c) = random.Normal(0, 1);
    for (int c = 0; c < 3 && has_point; ++c) dense(row, 3 * (row % 2) + c) = random.Normal(0, 1);
  }
  const Eigen::SparseMatrix<double, Eigen::RowMajor> sparse = dense.sparseView();
  const ReducedSystem system(sparse, 2);
  ASSERT_TRUE(system.ok());
  const Eigen::MatrixXd covariance = (dense.transpose() * dense).inverse();
  EXPECT_LT((system.Covariance(1, 2) - covariance.block<2, 2>(7, 7)).norm(), 1e-6 * covariance.norm());
  const Eigen::MatrixXd rows = dense.topRows(4);
  EXPECT_NEAR(system.Trace({0, 1, 2, 3}), (rows * covariance * rows.transpose()).trace(), 0.25);
  EXPECT_NEAR(system.Trace({2}), (rows.row(2) * covariance * rows.row(2).transpose())(0, 0), 1e-6);
}

}  // namespace
}  // namespace cairn::group_classes
