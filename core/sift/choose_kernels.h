#pragma once

#include <vector>

#include "core/sift/sift_kernels.h"

namespace cairn {

// The kernels that this processor can run, the slowest first; all give the same bits.
std::vector<const SiftKernels*> UsableSiftKernels();

// The fastest of them.
const SiftKernels& BestSiftKernels();

}  // namespace cairn
