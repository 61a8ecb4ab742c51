#include <arm_neon.h>

// One instruction each, where a comparison and a choice are two.  Of two zeros they may take the other one,
// which no comparison tells from the first.
#define CAIRN_SIFT_MAX vmaxq_f32
#define CAIRN_SIFT_MIN vminq_f32
#define CAIRN_SIFT_LANES 4
#include "core/sift/sift_kernels_body.h"

namespace cairn {

const SiftKernels kSiftNeon = CAIRN_SIFT_KERNELS("neon");

}  // namespace cairn
