#include "core/structure/camera_sensitivity.h"

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

}  // namespace
}  // namespace cairn
