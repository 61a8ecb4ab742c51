#include "core/structure/camera_sensitivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace cairn {

int NumFocals(CameraModel model) {
  switch (model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
      return 1;
    default:
      return 2;
  }
}

CameraSensitivity SensitivityOf(const Camera& camera, const Eigen::Vector2d& pixel,
                                const std::vector<int>& params) {
  constexpr double kStepPx = 1;
  // The pixel and its neighbours: right, left, lower, upper.
  const std::array<Eigen::Vector2d, 5> offsets = {Eigen::Vector2d(0, 0), Eigen::Vector2d(kStepPx, 0),
                                                  Eigen::Vector2d(-kStepPx, 0), Eigen::Vector2d(0, kStepPx),
                                                  Eigen::Vector2d(0, -kStepPx)};
  CameraSensitivity sensitivity(params.size());
  std::array<std::optional<Eigen::Vector3d>, 5> bearings;
  for (size_t i = 0; i < offsets.size(); ++i) {
    bearings[i] = BearingFromImage(camera, pixel + offsets[i]);
    if (!bearings[i]) return sensitivity;
  }
  for (size_t p = 0; p < params.size(); ++p) {
    const double step = 1e-6 * std::max(1.0, std::abs(camera.params[params[p]]));
    Camera less = camera, more = camera;
    less.params[params[p]] -= step;
    more.params[params[p]] += step;
    std::array<Eigen::Vector2d, 5> derivatives;
    for (size_t i = 0; i < bearings.size(); ++i) {
      const auto a = ImageFromCamera(less, *bearings[i]), b = ImageFromCamera(more, *bearings[i]);
      derivatives[i] = a && b ? Eigen::Vector2d((*b - *a) / (2 * step)) : Eigen::Vector2d::Zero().eval();
    }
    sensitivity[p].by_param = derivatives[0];
    sensitivity[p].growth.col(0) = (derivatives[1] - derivatives[2]) / (2 * kStepPx);
    sensitivity[p].growth.col(1) = (derivatives[3] - derivatives[4]) / (2 * kStepPx);
  }
  return sensitivity;
}

}  // namespace cairn
