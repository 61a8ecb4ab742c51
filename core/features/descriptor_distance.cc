#include "core/features/descriptor_distance.h"

#include "core/features/wide_clones.h"

namespace cairn {

CAIRN_WIDE_CLONES int32_t DescriptorDot(const uint8_t* a, const uint8_t* b) {
  int32_t dot = 0;
  for (int d = 0; d < kDescriptorDim; ++d) dot += static_cast<int32_t>(a[d]) * b[d];
  return dot;
}

}  // namespace cairn
