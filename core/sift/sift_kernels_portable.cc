#define CAIRN_SIFT_LANES 4
#include "core/sift/sift_kernels_body.h"

namespace cairn {

const SiftKernels kSiftPortable = CAIRN_SIFT_KERNELS("portable");

}  // namespace cairn
