#define CAIRN_SIFT_LANES 16
#include "core/sift/sift_kernels_body.h"

namespace cairn {

const SiftKernels kSiftAvx512 = CAIRN_SIFT_KERNELS("avx512");

}  // namespace cairn
