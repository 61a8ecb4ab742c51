#pragma once

// What SIFT needs of the functions whose last bits differ between mathematical libraries, from operations
// that IEEE 754 rounds exactly: the same bits on every system.  Errors are below 1e-15, relative.

#include <array>

#include "core/sift/sift_kernels.h"

namespace cairn {

// exp(x).  REQUIRES: x in [-700, 700]
double ExactExp(double x);

// 2^x.  REQUIRES: x in [-1000, 1000]
double ExactExp2(double x);

struct SineCosine {
  double sine = 0;
  double cosine = 0;
};
// Of an angle in degrees.  REQUIRES: |angle_deg| <= 1e6
SineCosine ExactSineCosine(double angle_deg);

// taps[i] = exp(-i^2 / (2 sigma^2)) over the sum of all 2 radius + 1, i = 0..radius.
// REQUIRES: radius <= kSiftMaxBlurRadius
std::array<float, kSiftMaxBlurRadius + 1> GaussianTaps(double squared_sigma, int radius);

// weights[i] = exp(-i^2 / (2 sigma^2)) for i = 0..radius.
void GaussianWeights(double squared_sigma, int radius, float* weights);

}  // namespace cairn
