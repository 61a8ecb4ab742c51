#include "core/structure/camera_sensitivity.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/camera/pixel_ray.h"
#include "tests/core/structure/lens.h"

namespace cairn {
namespace {

std::vector<int> AllParams(const Camera& camera) {
  std::vector<int> params;
  for (size_t p = 0; p < camera.params.size(); ++p) params.push_back(static_cast<int>(p));
  return params;
}

// A residual of a few pixels, by the camera before a change and the sensitivity, against the changed camera.
TEST(CameraSensitivity, ResidualsFollowAChangedCamera) {
  const Camera camera = Lens();
  Camera changed = camera;
  const std::vector<double> change = {4, 3, 2, -2, 0.01, -0.004, 0.001, 0.001};
  for (size_t p = 0; p < change.size(); ++p) changed.params[p] += change[p];
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(60, 70), Eigen::Vector2d(330, 220), Eigen::Vector2d(600, 430)}) {
    const auto ray = MakePixelRay(camera, pixel);
    const CameraSensitivity sensitivity = SensitivityOf(camera, pixel, AllParams(camera));
    const Eigen::Vector3d point = 3 * *BearingFromImage(camera, pixel + Eigen::Vector2d(3, -2));
    const Eigen::Vector2d before = ray->Residual(point);
    Eigen::Vector2d residual = before;
    for (size_t p = 0; p < change.size(); ++p)
      residual += change[p] * (sensitivity[p].by_param + sensitivity[p].growth * before);
    EXPECT_LT((residual - (*ImageFromCamera(changed, point) - pixel)).norm(), 0.05) << pixel.transpose();
    // What the growth is there for: a longer focal length stretches residuals.
    EXPECT_NEAR(sensitivity[0].growth(0, 0), 1.0 / 500, 3e-4);
  }
}

TEST(CameraSensitivity, FocalLengthsAreTheFirstParameters) {
  for (const CameraModel model :
       {CameraModel::kSimplePinhole, CameraModel::kSimpleRadial, CameraModel::kRadial,
        CameraModel::kSimpleRadialFisheye, CameraModel::kRadialFisheye})
    EXPECT_EQ(NumFocals(model), 1) << CameraModelName(model);
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kOpenCvFisheye, CameraModel::kFullOpenCv,
        CameraModel::kFov, CameraModel::kThinPrismFisheye})
    EXPECT_EQ(NumFocals(model), 2) << CameraModelName(model);
}

TEST(CameraSensitivity, OfAPinholeItIsTheRay) {
  // u = fx x + cx, v = fy y + cy.
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.params = {500, 400, 322, 238};
  const CameraSensitivity sensitivity = SensitivityOf(camera, {422, 138}, {1, 0, 3});
  ASSERT_EQ(sensitivity.size(), 3u);
  EXPECT_LT((sensitivity[0].by_param - Eigen::Vector2d(0, -0.25)).norm(), 1e-6);
  EXPECT_LT((sensitivity[1].by_param - Eigen::Vector2d(0.2, 0)).norm(), 1e-6);
  EXPECT_LT((sensitivity[2].by_param - Eigen::Vector2d(0, 1)).norm(), 1e-6);
  const Eigen::Matrix2d by_fy{{0, 0}, {0, 1.0 / 400}}, by_fx{{1.0 / 500, 0}, {0, 0}};
  EXPECT_LT((sensitivity[0].growth - by_fy).norm(), 1e-6);
  EXPECT_LT((sensitivity[1].growth - by_fx).norm(), 1e-6);
  EXPECT_LT(sensitivity[2].growth.norm(), 1e-6);
}

TEST(CameraSensitivity, IsNothingNextToWhatTheModelDoesNotSee) {
  // A view of 360 degrees: rays end on a circle of pi / omega focal lengths, here of 100 pi px.
  Camera camera;
  camera.model = CameraModel::kFov;
  camera.params = {100, 100, 400, 400, 1};
  const double edge = 400 + 100 * M_PI;
  EXPECT_GT(SensitivityOf(camera, {edge - 1.1, 400}, {0})[0].by_param.norm(), 1);
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(edge - 0.9, 400), Eigen::Vector2d(400, edge - 0.9),
        Eigen::Vector2d(800 - edge + 0.9, 400), Eigen::Vector2d(400, 800 - edge + 0.9),
        Eigen::Vector2d(edge + 5, 400)}) {
    const CameraSensitivity sensitivity = SensitivityOf(camera, pixel, {0, 4});
    ASSERT_EQ(sensitivity.size(), 2u);
    EXPECT_EQ(sensitivity[0].by_param.norm(), 0) << pixel.transpose();
    EXPECT_EQ(sensitivity[0].growth.norm(), 0);
  }
}

}  // namespace
}  // namespace cairn
