#include "core/features/descriptor_distance.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

// SIFT's, and one of every measure: floating point, bits, dense.
std::vector<DescriptorSpace> Spaces() {
  return {{},
          {64, 128, DescriptorMeasure::kAngle, 127.0 * 127},
          {256, 1, DescriptorMeasure::kHamming, 256},
          {64, 128, DescriptorMeasure::kDense, 127.0 * 127}};
}

TEST(LeastDotWithin, WhatIsLessIsFartherOff) {
  for (const DescriptorSpace& space : Spaces()) {
    const auto most = static_cast<int32_t>(space.squared_norm);
    std::vector<double> angles = {0, 1e-9, 0.1, 0.45, 0.9, 1.5, 1.6, 4};
    // Exactly those of some dot products.
    for (int32_t dot = 0; dot <= most; dot += std::max(1, most / 50))
      angles.push_back(DescriptorAngleRad(dot, space));
    for (const double angle : angles) {
      const int32_t least = LeastDotWithin(angle, space);
      EXPECT_GE(least, 0);
      for (const int32_t dot : {0, least / 2, least - 2, least - 1}) {
        if (dot < 0 || dot >= least) continue;
        EXPECT_GT(DescriptorAngleRad(dot, space), angle) << dot;
      }
      // And few others are: a hundredth of all at most.
      if (angle < 1.5) EXPECT_LE(DescriptorAngleRad(least + most / 100 + 3, space), angle + 1e-12) << angle;
    }
  }
}

TEST(DescriptorDots, AreThoseOfEachRow) {
  Random random(4);
  for (const DescriptorSpace& space : Spaces()) {
    DescriptorMatrix descriptors;
    descriptors.resize(40, space.num_values);
    for (int i = 0; i < 40; ++i) {
      for (int d = 0; d < space.num_values; ++d)
        descriptors(i, d) = static_cast<uint8_t>(random.UniformInt(0, space.offset == 1 ? 2 : 255));
    }
    const std::vector<int32_t> rows = {7, 0, 39, 7, 12};
    std::vector<int32_t> dots(rows.size() + 1, -5);
    DescriptorDots(descriptors.row(3).data(), descriptors, rows, space, dots.data());
    for (size_t k = 0; k < rows.size(); ++k)
      EXPECT_EQ(dots[k], DescriptorDot(descriptors.row(3).data(), descriptors.row(rows[k]).data(), space))
          << k;
    EXPECT_EQ(dots.back(), -5);
    DescriptorDots(descriptors.row(3).data(), descriptors, {}, space, dots.data());
  }
}

}  // namespace
}  // namespace cairn
