#include "stages/group_classes/triangulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/random.h"

namespace cairn {
namespace {

// Cameras at (0.3 i, 0, 0), all looking along z, and the ray of each to a point.
std::vector<PosedRay> Rays(int num, const Eigen::Vector3d& point, double noise_px, uint64_t seed) {
  Random random(seed);
  std::vector<PosedRay> rays(num);
  for (int i = 0; i < num; ++i) {
    rays[i].cam_from_world.translation = Eigen::Vector3d(-0.3 * i, 0, 0);
    rays[i].focal_px = 500;
    const Eigen::Vector3d p = rays[i].cam_from_world * point;
    rays[i].ray =
        p.hnormalized() + Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px)) / 500;
  }
  return rays;
}

TEST(Triangulate, NoiseFreeRaysMeetAtThePoint) {
  const Eigen::Vector3d point(0.4, -0.2, 3);
  const Triangulation result = Triangulate(Rays(5, point, 0, 1), {});
  ASSERT_EQ(result.outcome, TriangulateOutcome::kOk);
  EXPECT_LT((result.position - point).norm(), 1e-9);
  EXPECT_EQ(result.inliers.size(), 5u);
}

TEST(Triangulate, OutliersAreLeftOut) {
  const Eigen::Vector3d point(0.4, -0.2, 3);
  std::vector<PosedRay> rays = Rays(8, point, 0.3, 2);
  rays[1].ray += Eigen::Vector2d(0.2, 0);
  rays[4].ray += Eigen::Vector2d(0, -0.1);
  const Triangulation result = Triangulate(rays, {});
  ASSERT_EQ(result.outcome, TriangulateOutcome::kOk);
  EXPECT_THAT(result.inliers, testing::ElementsAre(0, 2, 3, 5, 6, 7));
  EXPECT_LT((result.position - point).norm(), 0.03);
}

TEST(Triangulate, FewRaysOrSmallAnglesAreRefusedWithTheReason) {
  EXPECT_EQ(Triangulate(Rays(2, {0, 0, 3}, 0, 1), {}).outcome, TriangulateOutcome::kFewObservations);
  EXPECT_EQ(Triangulate(Rays(4, {0, 0, 100}, 0, 1), {}).outcome, TriangulateOutcome::kSmallAngle);
  EXPECT_EQ(Triangulate({}, {}).outcome, TriangulateOutcome::kFewObservations);
}

TEST(Triangulate, PointBehindTheCamerasIsRefused) {
  std::vector<PosedRay> rays = Rays(4, {0.4, 0, 3}, 0, 1);
  for (PosedRay& ray : rays) ray.ray.x() = -ray.ray.x();  // rays that meet behind
  EXPECT_NE(Triangulate(rays, {}).outcome, TriangulateOutcome::kOk);
}

TEST(Triangulate, CovarianceIsTheSpreadOfManyTrials) {
  const Eigen::Vector3d point(0.4, -0.2, 3);
  constexpr int kTrials = 400;
  double squared = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Triangulation result = Triangulate(Rays(5, point, 1.0, 100 + trial), {});
    const Eigen::Vector3d error = result.position - point;
    squared += error.dot(result.covariance.inverse() * error);
  }
  // Chi-squared with 3 degrees of freedom: mean 3, standard deviation of the mean sqrt(6 / 400) = 0.12.
  EXPECT_NEAR(squared / kTrials, 3.0, 0.5);
}

}  // namespace
}  // namespace cairn
