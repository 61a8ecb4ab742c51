#pragma once

#include <array>
#include <cstdint>

#include "core/features/features.h"

namespace cairn {

// Transform coding of descriptors: neighbouring values of a SIFT descriptor are alike, so that most of the
// coefficients of its cosine transform are near 0 [Chandrasekhar, Takacs, Chen, Tsai, Singh, Girod,
// "Transform coding of image feature descriptors", VCIP 2009].  Differs from it: the transform is fixed (in x
// and y of the 4 x 4 cells DCT-II, over the 8 orientations, which have no end, the discrete Fourier transform
// in its real form) rather than learnt, so that no map stores it.  Integers alone: codes stand for the same
// descriptor everywhere.
struct TransformCode {
  int step = 24;  // of a coefficient's levels, in units of a descriptor's values.  REQUIRES: in [1, 255]
  std::array<uint8_t, kSiftDescriptorDim> mean = {};  // that codes of 0 alone stand for
  friend bool operator==(const TransformCode&, const TransformCode&) = default;
};

// Numbers of coefficients' levels, 0 the level around 0.  Coefficient (8 (4 v + u) + f) has frequency v in y,
// u in x; f: 0, cos and sin of 1, of 2, of 3, and 4 periods in 360 degrees.
using TransformLevels = std::array<int16_t, kSiftDescriptorDim>;

// The levels of a descriptor's coefficients: nearest, except that a level more takes 0.58 of a step, which
// makes more of them 0 [Sullivan, "Efficient scalar quantization of exponential and Laplacian random
// variables", 1996].  `descriptor`, of kSiftDescriptorDim values.
TransformLevels LevelsOf(const uint8_t* descriptor, const TransformCode& code);
// The descriptor that levels stand for.
void DescriptorOf(const TransformLevels& levels, const TransformCode& code, uint8_t* descriptor);

// Replaces every descriptor by a near one whose own levels stand for exactly it, so that maps store levels
// without a loss.  Returns the code: this step, and the descriptors' mean.
TransformCode QuantizeByTransform(int step, DescriptorMatrix* descriptors);

// The same with a code that is given.
void QuantizeByCode(const TransformCode& code, DescriptorMatrix* descriptors);

// Sum of a coefficient's frequencies in y, x and orientation, 0 to 10: natural images have less of higher
// ones.
int FrequencyOf(int coefficient);

}  // namespace cairn
