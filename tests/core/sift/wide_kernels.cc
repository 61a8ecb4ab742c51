#include "tests/core/sift/wide_kernels.h"

#define CAIRN_SIFT_LANES 16
#include "core/sift/sift_kernels_body.h"

namespace cairn {

const SiftKernels kSiftWide = CAIRN_SIFT_KERNELS("wide, of narrow registers");

}  // namespace cairn
