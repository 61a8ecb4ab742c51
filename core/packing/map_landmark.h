#pragma once

#include <Eigen/Core>

#include "core/base/ids.h"

namespace cairn {

struct MapLandmark {
  ClassId class_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // world frame, metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the position, m^2
  double scale_m = 0;                                    // size (sigma) of the feature in space; 0: not known
  int num_observations = 0;                              // survey images that see it
};

}  // namespace cairn
