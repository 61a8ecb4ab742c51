#pragma once

#include "core/sift/sift_kernels.h"

namespace cairn {

// The kernels for the widest registers, compiled for the baseline, which takes several of its registers for
// each: what the lanes do can be tested on a processor without them.
extern const SiftKernels kSiftWide;

}  // namespace cairn
