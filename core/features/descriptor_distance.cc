#include "core/features/descriptor_distance.h"

namespace cairn {

// Compiled twice where the processor may have wider integer instructions; the sum is the same.
#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target_clones("avx2", "default")))
#endif
int32_t
DescriptorDot(const uint8_t* a, const uint8_t* b) {
  int32_t dot = 0;
  for (int d = 0; d < kDescriptorDim; ++d) dot += static_cast<int32_t>(a[d]) * b[d];
  return dot;
}

}  // namespace cairn
