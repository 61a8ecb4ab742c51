#pragma once

#include <Eigen/Core>

#include "core/base/random.h"

namespace cairn {

// Anywhere in the cube of so much to either side of 0.
inline Eigen::Vector3d RandomVector(Random& random, double extent) {
  return {random.Uniform(-extent, extent), random.Uniform(-extent, extent), random.Uniform(-extent, extent)};
}

}  // namespace cairn
