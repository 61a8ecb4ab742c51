#include "core/sift/gaussian.h"

#include <cmath>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(ExactFunctions, AgreeWithTheMathematicalLibrary) {
  for (int i = -2000; i <= 2000; ++i) {
    const double x = i * 0.0137;
    EXPECT_NEAR(ExactExp(x) / std::exp(x), 1, 1e-14) << x;
    EXPECT_NEAR(ExactExp2(x) / std::exp2(x), 1, 1e-14) << x;
    const double deg = i * 1.7, rad = deg * M_PI / 180;
    EXPECT_NEAR(ExactSineCosine(deg).sine, std::sin(rad), 1e-13) << deg;
    EXPECT_NEAR(ExactSineCosine(deg).cosine, std::cos(rad), 1e-13) << deg;
  }
  EXPECT_EQ(ExactExp(0), 1);
  EXPECT_EQ(ExactExp2(3), 8);
  EXPECT_EQ(ExactSineCosine(90).cosine, 0);
  EXPECT_EQ(ExactSineCosine(-90).sine, -1);
}

TEST(GaussianTaps, AreProportionalToTheDensityAndSumToOne) {
  const auto taps = GaussianTaps(1.5 * 1.5, 6);
  double sum = taps[0];
  for (int i = 1; i <= 6; ++i) {
    sum += 2 * static_cast<double>(taps[i]);
    EXPECT_NEAR(taps[i] / taps[0], std::exp(-i * i / 4.5), 1e-6) << i;
  }
  EXPECT_NEAR(sum, 1, 1e-6);
  EXPECT_EQ(taps[7], 0);
}

TEST(GaussianWeights, AreTheDensityOverItsMaximum) {
  float weights[40];
  GaussianWeights(30.0, 39, weights);
  for (int i = 0; i < 40; ++i) EXPECT_NEAR(weights[i] / std::exp(-i * i / 60.0), 1, 1e-6) << i;
}

}  // namespace
}  // namespace cairn
