#pragma once

#include "core/features/features.h"

namespace cairn::emit_map {

// Rounds every value to one of 2^num_bits levels, those with the least squared error over all values [Lloyd,
// "Least squares quantization in PCM", 1982], so that a map stores num_bits a value.  8: nothing changes.
// REQUIRES: num_bits in [1, 8]
void QuantizeDescriptorValues(int num_bits, DescriptorMatrix* descriptors);

}  // namespace cairn::emit_map
