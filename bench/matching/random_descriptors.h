#pragma once

#include <cstdint>

#include "core/base/random.h"
#include "core/features/features.h"

namespace cairn {

// Descriptors of RootSIFT's norm: the mean square of 0 to 78 is 2^18 / 128.
inline DescriptorMatrix RandomDescriptors(int num, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, kSiftDescriptorDim);
  for (int i = 0; i < num; ++i) {
    for (int d = 0; d < kSiftDescriptorDim; ++d)
      descriptors(i, d) = static_cast<uint8_t>(random.UniformInt(0, 78));
  }
  return descriptors;
}

}  // namespace cairn
