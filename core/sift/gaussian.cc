#include "core/sift/gaussian.h"

#include <cmath>

namespace cairn {
namespace {

constexpr double kLn2 = 0.69314718055994530942;
constexpr double kRadPerDeg = 0.017453292519943295769;

// 1 + x (1 + x/2 (1 + x/3 ...)): Taylor's series of exp.  REQUIRES: |x| <= ln(2) / 2
double ExpNearZero(double x) {
  double sum = 1;
  for (int i = 16; i >= 1; --i) sum = 1 + x * sum / i;
  return sum;
}

// Taylor's series of sin (first = 1) and of cos (first = 0).  REQUIRES: |x| <= pi / 4
double SineNearZero(double x, int first) {
  double sum = 1;
  for (int i = first + 16; i > first; i -= 2) sum = 1 - x * x * sum / (i * (i - 1));
  return first == 1 ? x * sum : sum;
}

}  // namespace

double ExactExp2(double x) {
  const double whole = std::nearbyint(x);
  return std::ldexp(ExpNearZero((x - whole) * kLn2), static_cast<int>(whole));
}

double ExactExp(double x) {
  const double whole = std::nearbyint(x / kLn2);
  return std::ldexp(ExpNearZero(x - whole * kLn2), static_cast<int>(whole));
}

SineCosine ExactSineCosine(double angle_deg) {
  const double quarters = std::nearbyint(angle_deg / 90);
  const double rest = (angle_deg - 90 * quarters) * kRadPerDeg;
  const double sine = SineNearZero(rest, 1), cosine = SineNearZero(rest, 0);
  switch (static_cast<int>(quarters) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

void GaussianWeights(double squared_sigma, int radius, float* weights) {
  // exp(-(i + 1)^2 / (2 s^2)) = exp(-i^2 / (2 s^2)) q^(2 i + 1), q = exp(-1 / (2 s^2)).
  const double q = ExactExp(-0.5 / squared_sigma);
  double weight = 1, ratio = q;
  for (int i = 0; i <= radius; ++i) {
    weights[i] = static_cast<float>(weight);
    weight *= ratio;
    ratio *= q * q;
  }
}

std::array<float, kSiftMaxBlurRadius + 1> GaussianTaps(double squared_sigma, int radius) {
  std::array<double, kSiftMaxBlurRadius + 1> values{};
  double sum = 0;
  for (int i = radius; i >= 0; --i) {
    values[i] = ExactExp(-0.5 * i * i / squared_sigma);
    sum += (i > 0 ? 2 : 1) * values[i];
  }
  std::array<float, kSiftMaxBlurRadius + 1> taps{};
  for (int i = 0; i <= radius; ++i) taps[i] = static_cast<float>(values[i] / sum);
  return taps;
}

}  // namespace cairn
