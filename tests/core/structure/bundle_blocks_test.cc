#include "core/structure/bundle_blocks.h"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "tests/core/structure/lens.h"

// Of OpenMP's runtime, as bundle_blocks.cc has the other.
extern "C" int omp_get_max_active_levels();

namespace cairn {
namespace {

Pose TurnedPose() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized())), {0.3, -0.2, 4}};
}

TEST(BundleBlocks, APoseIsStoredAndLoaded) {
  const Pose pose = TurnedPose();
  std::array<double, kPoseBlockSize> block;
  StorePose(pose, block.data());
  EXPECT_EQ(Eigen::Vector3d(block[0], block[1], block[2]), pose.rotation.vec());
  EXPECT_EQ(block[3], pose.rotation.w());
  EXPECT_EQ(Eigen::Vector3d(block[4], block[5], block[6]), pose.translation);
  for (int k = 0; k < 4; ++k) block[k] *= 2;  // a quaternion of any length
  EXPECT_LT(LoadPose(block.data()).rotation.angularDistance(pose.rotation), 1e-7);
  EXPECT_NEAR(LoadPose(block.data()).rotation.norm(), 1, 1e-12);
  EXPECT_EQ(LoadPose(block.data()).translation, pose.translation);
}

// A pose, a point and the changes of two of the camera's parameters; the point is seen a few pixels beside
// its ray.
struct SeenPoint {
  std::array<double, kPoseBlockSize> pose;
  std::array<double, 3> point = {0.2, -0.5, 0.4};
  std::array<double, 2> changes = {3, -0.02};
  PixelRay ray;
  CameraSensitivity sensitivity;

  explicit SeenPoint(bool is_camera_free) {
    StorePose(TurnedPose(), pose.data());
    const Eigen::Vector2d pixel = *ImageFromCamera(Lens(), InCamera()) + Eigen::Vector2d(4, -3);
    ray = *MakePixelRay(Lens(), pixel);
    if (is_camera_free) sensitivity = SensitivityOf(Lens(), pixel, {0, 4});
  }
  Eigen::Vector3d InCamera() const { return TurnedPose() * Eigen::Vector3d(point.data()); }
  std::vector<double*> Blocks() {
    if (sensitivity.empty()) return {pose.data(), point.data()};
    return {pose.data(), point.data(), changes.data()};
  }
};

TEST(ReprojectionCost, IsTheResidualInStandardDeviations) {
  SeenPoint seen(true);
  const Eigen::Vector2d before = seen.ray.Residual(seen.InCamera());
  EXPECT_NEAR(before.norm(), 5, 0.2);
  Eigen::Vector2d expected = before;  // core/structure/camera_sensitivity.h
  for (int p = 0; p < 2; ++p)
    expected += seen.changes[p] * (seen.sensitivity[p].by_param + seen.sensitivity[p].growth * before);
  EXPECT_GT((expected - before).norm(), 0.2);
  Eigen::Vector2d residual;
  const ReprojectionCost free_camera(seen.ray, seen.sensitivity, 2.5);
  EXPECT_EQ(free_camera.num_residuals(), 2);
  EXPECT_EQ(free_camera.parameter_block_sizes(), (std::vector<int32_t>{7, 3, 2}));
  ASSERT_TRUE(free_camera.Evaluate(seen.Blocks().data(), residual.data(), nullptr));
  EXPECT_LT((2.5 * residual - expected).norm(), 1e-12);
  const CameraSensitivity none;
  const ReprojectionCost held_camera(seen.ray, none, 2.5);
  EXPECT_EQ(held_camera.parameter_block_sizes(), (std::vector<int32_t>{7, 3}));
  ASSERT_TRUE(held_camera.Evaluate(seen.Blocks().data(), residual.data(), nullptr));
  EXPECT_LT((2.5 * residual - before).norm(), 1e-12);
}

TEST(ReprojectionCost, DerivativesAreThoseOfDifferences) {
  for (const bool is_camera_free : {false, true}) {
    SeenPoint seen(is_camera_free);
    const ReprojectionCost cost(seen.ray, seen.sensitivity, 0.8);
    const std::vector<double*> blocks = seen.Blocks();
    std::array<std::array<double, 14>, 3> jacobians;
    std::array<double*, 3> pointers = {jacobians[0].data(), jacobians[1].data(), jacobians[2].data()};
    Eigen::Vector2d residual;
    ASSERT_TRUE(cost.Evaluate(blocks.data(), residual.data(), pointers.data()));
    for (size_t b = 0; b < blocks.size(); ++b) {
      const int size = cost.parameter_block_sizes()[b];
      for (int k = 0; k < size; ++k) {
        constexpr double kStep = 1e-6;
        const double value = blocks[b][k];
        Eigen::Vector2d more, less;
        blocks[b][k] = value + kStep;
        ASSERT_TRUE(cost.Evaluate(blocks.data(), more.data(), nullptr));
        blocks[b][k] = value - kStep;
        ASSERT_TRUE(cost.Evaluate(blocks.data(), less.data(), nullptr));
        blocks[b][k] = value;
        for (int row = 0; row < 2; ++row) {
          const double expected = (more[row] - less[row]) / (2 * kStep);
          EXPECT_NEAR(jacobians[b][row * size + k], expected, 1e-6 * (1 + std::abs(expected)))
              << b << " " << k;
        }
      }
      // Of one block alone.
      std::array<double*, 3> alone = {};
      std::array<double, 14> of_block;
      alone[b] = of_block.data();
      ASSERT_TRUE(cost.Evaluate(blocks.data(), residual.data(), alone.data()));
      for (int k = 0; k < 2 * size; ++k) EXPECT_EQ(of_block[k], jacobians[b][k]);
    }
  }
}

TEST(ReprojectionCost, APointBesideTheCameraHasNoResidual) {
  std::array<double, kPoseBlockSize> pose;
  StorePose(Pose(), pose.data());
  const PixelRay ray = *MakePixelRay(Lens(), {400, 200});
  const CameraSensitivity none;
  const ReprojectionCost cost(ray, none, 1);
  // At these depths.
  for (const double depth : {0.0, 0.5e-12, -0.5e-12, 2e-12, -2e-12, -3.0}) {
    const std::array<double, 3> point = {0.1, 0.2, depth};
    const std::array<const double*, 2> blocks = {pose.data(), point.data()};
    Eigen::Vector2d residual;
    EXPECT_EQ(cost.Evaluate(blocks.data(), residual.data(), nullptr), std::abs(depth) > 1e-12) << depth;
  }
}

struct Apart {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0] - T(7);
    return true;
  }
};

TEST(SolveOnOneThread, SolvesOnOneThreadWhateverTheOptionsSay) {
  double x = 0;
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Apart, 1, 1>(new Apart), nullptr, &x);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.num_threads = 3;
  const ceres::Solver::Summary summary = SolveOnOneThread(options, &problem);
  EXPECT_NEAR(x, 7, 1e-6);
  EXPECT_EQ(summary.linear_solver_type_used, ceres::SPARSE_NORMAL_CHOLESKY);
  EXPECT_EQ(summary.sparse_linear_algebra_library_type, ceres::SUITE_SPARSE);
  EXPECT_EQ(summary.num_threads_used, 1);
  EXPECT_EQ(omp_get_max_active_levels(), 0);  // nor does CHOLMOD start threads
}

}  // namespace
}  // namespace cairn
