#include "core/features/transform_code.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

DescriptorMatrix RandomDescriptors(int count, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(count, kSiftDescriptorDim);
  for (Eigen::Index i = 0; i < descriptors.size(); ++i) {
    // Many small values and few large ones, as in SIFT.
    descriptors.data()[i] = static_cast<uint8_t>(
        std::min(255.0, 20 * std::abs(random.Normal(0, 1)) * std::abs(random.Normal(0, 1.5))));
  }
  return descriptors;
}

double MeanSquaredError(const DescriptorMatrix& a, const DescriptorMatrix& b) {
  return (a.cast<double>() - b.cast<double>()).squaredNorm() / static_cast<double>(a.size());
}

// All values 8 more than the mean: the coefficient of frequency 0 is 8 sqrt(128) = 90.5, no other.
TEST(TransformCode, AConstantIsOneCoefficient) {
  TransformCode code{.step = 24};
  code.mean.fill(50);
  std::array<uint8_t, kSiftDescriptorDim> descriptor;
  descriptor.fill(58);
  TransformLevels levels = LevelsOf(descriptor.data(), code);
  EXPECT_EQ(levels[0], 4);  // 90.5 / 24 = 3.77
  levels[0] = 0;
  EXPECT_EQ(levels, TransformLevels());
  // Level 4 stands for (4 - 1 / 32) 24 = 95.25, so a value for 95.25 / sqrt(128) = 8.4.
  levels[0] = 4;
  DescriptorOf(levels, code, descriptor.data());
  EXPECT_EQ(descriptor[0], 58);
  EXPECT_EQ(descriptor[127], 58);
}

// cos of one period over the orientations, in cells that alternate not at all: coefficient 1.
TEST(TransformCode, AWaveOverOrientationsIsOneCoefficient) {
  TransformCode code{.step = 10};
  code.mean.fill(100);
  std::array<uint8_t, kSiftDescriptorDim> descriptor;
  for (int i = 0; i < kSiftDescriptorDim; ++i)
    descriptor[i] = static_cast<uint8_t>(std::lround(100 + 40 * std::cos(2 * M_PI * (i % 8) / 8)));
  TransformLevels levels = LevelsOf(descriptor.data(), code);
  EXPECT_EQ(levels[1], 32);  // 40 sqrt(16 * 4) = 320
  levels[1] = 0;
  EXPECT_EQ(levels, TransformLevels());
  EXPECT_EQ(FrequencyOf(1), 1);
  EXPECT_EQ(FrequencyOf(7), 4);
  EXPECT_EQ(FrequencyOf(127), 10);
}

TEST(TransformCode, QuantizedDescriptorsAreWhatTheirLevelsStandFor) {
  for (const int step : {6, 24, 96}) {
    DescriptorMatrix descriptors = RandomDescriptors(300, 3);
    const TransformCode code = QuantizeByTransform(step, &descriptors);
    for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
      std::array<uint8_t, kSiftDescriptorDim> stands_for;
      DescriptorOf(LevelsOf(descriptors.row(i).data(), code), code, stands_for.data());
      EXPECT_TRUE(std::equal(stands_for.begin(), stands_for.end(), descriptors.row(i).data())) << i;
    }
  }
}

// Uniform levels make a squared error of step^2 / 12, a wider zero makes it a little more.
TEST(TransformCode, ErrorIsThatOfTheStep) {
  const DescriptorMatrix given = RandomDescriptors(500, 4);
  for (const int step : {6, 12, 24}) {
    DescriptorMatrix descriptors = given;
    QuantizeByTransform(step, &descriptors);
    EXPECT_LT(MeanSquaredError(given, descriptors), 1.25 * step * step / 12.0 + 0.5) << step;
  }
}

}  // namespace
}  // namespace cairn
