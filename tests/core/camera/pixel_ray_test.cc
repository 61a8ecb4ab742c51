#include "core/camera/pixel_ray.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

// Of an image of 800 x 800.
Camera WideOrNarrow(CameraModel model, const std::vector<double>& more) {
  Camera camera;
  camera.model = model;
  camera.width = camera.height = 800;
  camera.params = {300, 310, 400, 390};
  camera.params.insert(camera.params.end(), more.begin(), more.end());
  return camera;
}

TEST(PixelRay, OfAPinholeResidualsArePixelsExactly) {
  const Camera camera = WideOrNarrow(CameraModel::kPinhole, {});
  const Eigen::Vector2d pixel(550, 235);
  const PixelRay ray = *MakePixelRay(camera, pixel);
  EXPECT_LT((ray.bearing - Eigen::Vector3d(0.5, -0.5, 1).normalized()).norm(), 1e-12);
  EXPECT_EQ(ray.normal, Eigen::Vector3d::UnitZ());
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(1, -1, 2), {0, 0, 1}, {3, 2, 5}, {-1, 1, 0.5}})
    EXPECT_LT((ray.Residual(point) - (*ImageFromCamera(camera, point) - pixel)).norm(), 1e-5);
}

TEST(PixelRay, NearTheRayResidualsArePixelsOfEveryModel) {
  for (const Camera& camera :
       {WideOrNarrow(CameraModel::kOpenCv, {-0.1, 0.02, 0.001, -0.002}),
        WideOrNarrow(CameraModel::kFullOpenCv, {-0.1, 0.02, 0.001, -0.002, 0, 0, 0, 0}),
        WideOrNarrow(CameraModel::kFov, {0.95}),
        WideOrNarrow(CameraModel::kOpenCvFisheye, {0.01, -0.002, 0, 0})}) {
    const bool is_perspective =
        camera.model == CameraModel::kOpenCv || camera.model == CameraModel::kFullOpenCv;
    for (const double x : {100.0, 400.0, 640.0}) {
      const Eigen::Vector2d pixel(x, 300), beside = pixel + Eigen::Vector2d(0.03, -0.04);
      const PixelRay ray = *MakePixelRay(camera, pixel);
      EXPECT_LT((ray.normal - (is_perspective ? Eigen::Vector3d::UnitZ() : *BearingFromImage(camera, pixel)))
                    .norm(),
                1e-12);
      const Eigen::Vector3d point = 7 * *BearingFromImage(camera, beside);
      EXPECT_LT((ray.Residual(point) - (beside - pixel)).norm(), 1e-4)
          << CameraModelName(camera.model) << " " << x;
      EXPECT_LT(ray.Residual(7 * ray.bearing).norm(), 1e-9);
    }
  }
}

TEST(PixelRay, APixelThatTheModelDoesNotSeeHasNone) {
  // r (1 - 0.3 r^2) is 0.7027 at most.
  Camera camera = WideOrNarrow(CameraModel::kSimpleRadial, {});
  camera.params = {100, 0, 0, -0.3};
  EXPECT_TRUE(MakePixelRay(camera, {70, 0}));
  EXPECT_FALSE(MakePixelRay(camera, {71, 0}));
}

TEST(PixelRay, ALongerLensSeesThePixelNearerToTheAxis) {
  Camera camera = WideOrNarrow(CameraModel::kPinhole, {});
  const PixelRay ray = *MakePixelRay(camera, {550, 235});
  camera.params[0] *= 2.5;
  camera.params[1] *= 2.5;
  const PixelRay expected = *MakePixelRay(camera, {550, 235}), scaled = WithFocalRatio(ray, 2.5);
  EXPECT_LT((scaled.bearing - expected.bearing).norm(), 1e-12);
  EXPECT_LT((scaled.pixel_from_plane - expected.pixel_from_plane).norm(), 1e-4);
  EXPECT_EQ(scaled.normal, expected.normal);
}

TEST(PixelRay, SizesGoWithDepthOrWithDistance) {
  const Eigen::Vector3d point(2, 3, 6);
  for (const CameraModel model :
       {CameraModel::kSimplePinhole, CameraModel::kOpenCv, CameraModel::kFullOpenCv}) {
    Camera camera;
    camera.model = model;
    EXPECT_EQ(DepthOfScale(camera, point), 6) << CameraModelName(model);
  }
  for (const CameraModel model : {CameraModel::kOpenCvFisheye, CameraModel::kFov,
                                  CameraModel::kSimpleRadialFisheye, CameraModel::kEquirectangular}) {
    Camera camera;
    camera.model = model;
    EXPECT_EQ(DepthOfScale(camera, point), 7) << CameraModelName(model);
  }
}

}  // namespace
}  // namespace cairn
