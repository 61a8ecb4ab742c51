#pragma once

#include "core/features/features.h"

namespace cairn::emit_map {

// Rounds every value to one of 2^num_bits levels, those with the least squared error over all values [Lloyd,
// "Least squares quantization in PCM", 1982], so that a map stores num_bits a value.  8: nothing changes.
// REQUIRES: num_bits in [1, 8]
void QuantizeDescriptorValues(int num_bits, DescriptorMatrix* descriptors);

// The step of a transform's levels (core/features/transform_code.h) that err as those of values in so many
// bits: at 3 and at 2 bits by squares of 42 and 69.  REQUIRES: num_bits in [1, kMostTransformBits]
inline constexpr int kMostTransformBits = 6;  // with more, it does not pay
int TransformStep(int num_bits);
// The fewest bits whose levels are as fine as those of a transform with this step.
int BitsOfStep(int step);

}  // namespace cairn::emit_map
