#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/camera/camera.h"

namespace cairn {

// How many of a model's parameters, the first ones, are focal lengths.
int NumFocals(CameraModel model);

// How a pixel moves with parameters of its camera.  A residual r of the camera before the change d becomes
//   r + sum_p d_p (by_param_p + growth_p r)
// The growth must not be left out: without it residuals seem to shrink as the focal length grows, and every
// focal length is found too long.
struct ParameterSensitivity {
  Eigen::Vector2d by_param = Eigen::Vector2d::Zero();  // d pixel / d parameter, along the pixel's ray
  Eigen::Matrix2d growth = Eigen::Matrix2d::Zero();    // d by_param / d pixel
};
using CameraSensitivity = std::vector<ParameterSensitivity>;  // per parameter

// Of parameters by their indices, by differences; zero where the model does not see the pixel's neighbours.
CameraSensitivity SensitivityOf(const Camera& camera, const Eigen::Vector2d& pixel,
                                const std::vector<int>& params);

}  // namespace cairn
