#include "core/structure/triangulate.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

// Of a pinhole camera with f = 500 px.
PixelRay RayOf(const Eigen::Vector2d& normalised) {
  Camera camera;
  camera.params = {500, 320, 240};
  return *MakePixelRay(camera, 500 * normalised + Eigen::Vector2d(320, 240));
}

// Cameras at (0.3 i, 0, 0), all looking along z, and the ray of each to a point.
std::vector<PosedRay> Rays(int num, const Eigen::Vector3d& point, double noise_px, uint64_t seed) {
  Random random(seed);
  std::vector<PosedRay> rays(num);
  for (int i = 0; i < num; ++i) {
    rays[i].cam_from_world.translation = Eigen::Vector3d(-0.3 * i, 0, 0);
    const Eigen::Vector3d p = rays[i].cam_from_world * point;
    rays[i].ray = RayOf(p.hnormalized() +
                        Eigen::Vector2d(random.Normal(0, noise_px), random.Normal(0, noise_px)) / 500);
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
  rays[1].ray = RayOf(rays[1].ray.bearing.hnormalized() + Eigen::Vector2d(0.2, 0));
  rays[4].ray = RayOf(rays[4].ray.bearing.hnormalized() + Eigen::Vector2d(0, -0.1));
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
  for (PosedRay& ray : rays) {  // rays that meet behind
    const Eigen::Vector2d normalised = ray.ray.bearing.hnormalized();
    ray.ray = RayOf({-normalised.x(), normalised.y()});
  }
  EXPECT_NE(Triangulate(rays, {}).outcome, TriangulateOutcome::kOk);
}

TEST(Triangulate, FisheyeRaysBeyondNinetyDegreesMeetAtThePoint) {
  // Cameras at (0.3 i, 0, 0) that look along z; the point lies behind their image planes, 100 to 120 degrees
  // off their axes.
  Camera camera;
  camera.model = CameraModel::kOpenCvFisheye;
  camera.width = camera.height = 800;
  camera.params = {180, 180, 400, 400, 0.01, -0.002, 1e-4, 0};
  const Eigen::Vector3d point(0.5, 2, -0.6);
  Random random(5);
  std::vector<PosedRay> rays(6);
  for (size_t i = 0; i < rays.size(); ++i) {
    rays[i].cam_from_world.translation = Eigen::Vector3d(-0.3 * static_cast<double>(i), 0, 0);
    const Eigen::Vector2d pixel = *ImageFromCamera(camera, rays[i].cam_from_world * point) +
                                  Eigen::Vector2d(random.Normal(0, 0.1), random.Normal(0, 0.1));
    rays[i].ray = *MakePixelRay(camera, pixel);
    EXPECT_LT(rays[i].ray.bearing.z(), -0.17);
  }
  const Triangulation result = Triangulate(rays, {});
  ASSERT_EQ(result.outcome, TriangulateOutcome::kOk);
  EXPECT_EQ(result.inliers.size(), rays.size());
  EXPECT_LT((result.position - point).norm(), 0.01);
  EXPECT_LT(result.rms_error_px, 0.3);
}

TEST(Triangulate, ResidualsAreThePixelsOfEveryModel) {
  // Two pixels beside its own ray, a point is seen two pixels away, at the border of a wide image too.
  for (const CameraModel model : {CameraModel::kPinhole, CameraModel::kFov, CameraModel::kOpenCvFisheye}) {
    Camera camera;
    camera.model = model;
    camera.width = camera.height = 800;
    camera.params = {180, 190, 400, 400};
    if (model == CameraModel::kFov) camera.params.push_back(0.95);
    if (model == CameraModel::kOpenCvFisheye) camera.params.insert(camera.params.end(), {0.01, -0.002, 0, 0});
    for (const double x : {400.0, 500.0, 650.0, 720.0}) {
      const PixelRay ray = *MakePixelRay(camera, {x, 300});
      const Eigen::Vector3d beside = 3 * *BearingFromImage(camera, {x + 1.2, 301.6});
      EXPECT_NEAR((ray.Residual(beside) - Eigen::Vector2d(1.2, 1.6)).norm(), 0, 0.03)
          << CameraModelName(model);
    }
  }
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

// Cameras here and there that look along z, of which some see a point and each of the others a place of its
// own.
std::vector<PosedRay> RaysOfWhichSomeMeet(int num, const std::vector<int>& meeting, uint64_t seed) {
  Random random(seed);
  const auto between = [&](double low, double high) {
    const double x = random.Uniform(-1, 1), y = random.Uniform(-1, 1);
    return Eigen::Vector3d(x, y, random.Uniform(low, high));
  };
  const Eigen::Vector3d point = between(4, 6);
  std::vector<PosedRay> rays(num);
  for (int i = 0; i < num; ++i) {
    rays[i].cam_from_world.translation = between(-1, 1);
    const bool does_meet = std::count(meeting.begin(), meeting.end(), i) > 0;
    rays[i].ray = RayOf((rays[i].cam_from_world * (does_meet ? point : between(3, 9))).hnormalized());
  }
  return rays;
}

TEST(Triangulate, AsManyRaysAsAreAskedForAreEnough) {
  const Eigen::Vector3d point(0.4, -0.2, 3);
  EXPECT_EQ(Triangulate(Rays(3, point, 0, 1), {}).outcome, TriangulateOutcome::kOk);
  const TriangulateOptions four = {.min_num_observations = 4};
  EXPECT_EQ(Triangulate(Rays(3, point, 0, 1), four).outcome, TriangulateOutcome::kFewObservations);
  EXPECT_EQ(Triangulate(Rays(4, point, 0, 1), four).outcome, TriangulateOutcome::kOk);
  std::vector<PosedRay> rays = Rays(5, point, 0, 1);  // of which four agree, then three
  rays[2].ray = RayOf({0.5, 0.5});
  EXPECT_EQ(Triangulate(rays, four).outcome, TriangulateOutcome::kOk);
  rays[1].ray = RayOf({0.5, -0.5});
  EXPECT_EQ(Triangulate(rays, four).outcome, TriangulateOutcome::kFewObservations);
}

TEST(Triangulate, ThreeRaysMeetWhereverCamerasStand) {
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    const std::vector<PosedRay> rays = RaysOfWhichSomeMeet(3, {0, 1, 2}, seed);
    const Triangulation result = Triangulate(rays, {.min_triangulation_angle_deg = 0.1});
    ASSERT_EQ(result.outcome, TriangulateOutcome::kOk) << seed;
    for (const PosedRay& ray : rays)
      EXPECT_LT(ray.ray.Residual(ray.cam_from_world * result.position).norm(), 1e-6) << seed;
  }
}

TEST(Triangulate, TheSmallestAngleIsThatOfTheRaysFarthestApart) {
  // Cameras at 0, 0.3 and 0.6 m, a point 5 m in front of the middle: 2 atan(0.3 / 5) = 6.867 degrees.
  const std::vector<PosedRay> rays = Rays(3, {0.3, 0, 5}, 0, 1);
  EXPECT_EQ(Triangulate(rays, {.min_triangulation_angle_deg = 6.86}).outcome, TriangulateOutcome::kOk);
  EXPECT_EQ(Triangulate(rays, {.min_triangulation_angle_deg = 6.88}).outcome,
            TriangulateOutcome::kSmallAngle);
}

TEST(Triangulate, ARayIsKeptUpToTheLargestError) {
  // Of twenty rays the first is some pixels off, of which the point follows a little.
  const Eigen::Vector3d point(0.4, -0.2, 3);
  std::vector<PosedRay> rays = Rays(20, point, 0, 1);
  const Eigen::Vector2d seen = rays[0].ray.bearing.hnormalized();
  rays[0].ray = RayOf(seen + Eigen::Vector2d(0, 3.9 / 500));
  EXPECT_EQ(Triangulate(rays, {}).inliers.size(), 20u);
  rays[0].ray = RayOf(seen + Eigen::Vector2d(0, 4.4 / 500));
  EXPECT_EQ(Triangulate(rays, {}).inliers.size(), 19u);
  EXPECT_EQ(Triangulate(rays, {.max_reprojection_error_px = 4.4}).inliers.size(), 20u);
}

TEST(Triangulate, MostRaysWinThenThoseThatMeetBest) {
  // The first rays meet in one point, the others in another one.
  const Eigen::Vector3d left(-2, 0.3, 4), right(3, -0.5, 5);
  const auto meeting = [&](int num_left, double noise_left_px, int num_right, double noise_right_px) {
    std::vector<PosedRay> rays = Rays(num_left, left, noise_left_px, 3);
    const std::vector<PosedRay> others = Rays(num_right, right, noise_right_px, 4);
    rays.insert(rays.end(), others.begin(), others.end());
    return Triangulate(rays, {}).position;
  };
  EXPECT_LT((meeting(3, 0, 4, 0) - right).norm(), 1e-6);
  EXPECT_LT((meeting(4, 0, 3, 0) - left).norm(), 1e-6);
  EXPECT_LT((meeting(3, 0.3, 4, 0.6) - right).norm(), 0.2);
  EXPECT_LT((meeting(3, 0.3, 3, 0) - right).norm(), 1e-6);
  EXPECT_LT((meeting(3, 0, 3, 0.3) - left).norm(), 1e-6);
}

TEST(Triangulate, TriesAllPairsOfSixRaysAndFifteenOfMore) {
  // Two rays meet, the others pass each other by: the point is found where these two are tried.
  const TriangulateOptions options = {
      .max_reprojection_error_px = 0.01, .min_triangulation_angle_deg = 0.01, .min_num_observations = 2};
  for (const int n : {4, 6, 7, 12}) {
    int num_tried = 0;
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) {
        const Triangulation result = Triangulate(RaysOfWhichSomeMeet(n, {i, j}, 100 * i + j + 7), options);
        const bool is_found =
            result.outcome == TriangulateOutcome::kOk && result.inliers == std::vector<int>{i, j};
        num_tried += is_found ? 1 : 0;
        const bool is_first_or_last = j == 1 || i == n - 2;
        EXPECT_TRUE(is_found || !is_first_or_last) << i << " " << j;
      }
    }
    EXPECT_EQ(num_tried, std::min(n * (n - 1) / 2, 15)) << n;
  }
}

// The sum of the squared errors of some rays, each projected by its camera, of which all are Rays().
double SumOfSquares(const std::vector<PosedRay>& rays, const std::vector<int>& idxs,
                    const Eigen::Vector3d& position) {
  double sum = 0;
  for (const int i : idxs) {
    const Eigen::Vector2d seen = rays[i].ray.bearing.hnormalized();
    sum += (500 * ((rays[i].cam_from_world * position).hnormalized() - seen)).squaredNorm();
  }
  return sum;
}

TEST(Triangulate, ErrorIsLeastWhereThePointIs) {
  std::vector<PosedRay> rays = Rays(9, {0.4, -0.2, 3}, 1.0, 7);
  rays[3].ray = RayOf({0.9, 0.4});
  const Triangulation result = Triangulate(rays, {});
  ASSERT_EQ(result.outcome, TriangulateOutcome::kOk);
  EXPECT_THAT(result.inliers, testing::ElementsAre(0, 1, 2, 4, 5, 6, 7, 8));
  const double least = SumOfSquares(rays, result.inliers, result.position);
  EXPECT_NEAR(result.rms_error_px, std::sqrt(least / 8), 1e-9);
  // The covariance is the inverse of half the matrix of second derivatives.
  constexpr double kStep = 1e-4;
  Eigen::Matrix3d half_curvature;
  for (int a = 0; a < 3; ++a) {
    const Eigen::Vector3d along_a = kStep * Eigen::Vector3d::Unit(a);
    EXPECT_GT(SumOfSquares(rays, result.inliers, result.position + along_a), least);
    EXPECT_GT(SumOfSquares(rays, result.inliers, result.position - along_a), least);
    for (int b = 0; b < 3; ++b) {
      const Eigen::Vector3d along_b = kStep * Eigen::Vector3d::Unit(b);
      const auto at = [&](int sign_a, int sign_b) {
        return SumOfSquares(rays, result.inliers, result.position + sign_a * along_a + sign_b * along_b);
      };
      half_curvature(a, b) = 0.5 * (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * kStep * kStep);
    }
  }
  const Eigen::Matrix3d expected = half_curvature.inverse();
  EXPECT_LT((result.covariance - expected).norm(), 0.03 * expected.norm());
  EXPECT_EQ(result.covariance, result.covariance.transpose());
}

}  // namespace
}  // namespace cairn
