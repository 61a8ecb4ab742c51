#define CAIRN_SIFT_LANES 8
#include "core/sift/sift_kernels_body.h"

namespace cairn {

const SiftKernels kSiftAvx2 = CAIRN_SIFT_KERNELS("avx2");

}  // namespace cairn
