#include "core/structure/triangulate.h"

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

}  // namespace
}  // namespace cairn
