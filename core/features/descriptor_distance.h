#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/features/features.h"

namespace cairn {

// Squared norm of a RootSIFT descriptor, up to rounding.
inline constexpr double kSquaredDescriptorNorm = 512.0 * 512.0;

// Dot product of two descriptors of kDescriptorDim entries.
int32_t DescriptorDot(const uint8_t* a, const uint8_t* b);

// The angle between two RootSIFT descriptors of this dot product, radians in [0, pi / 2].
inline double DescriptorAngleRad(int32_t dot) {
  return std::acos(std::clamp(dot / kSquaredDescriptorNorm, 0.0, 1.0));
}

}  // namespace cairn
