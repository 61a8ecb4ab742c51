#include "core/vocabulary/nearest_centre.h"

#include <array>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

DescriptorMatrix RandomRows(int num_rows, int max_value, Random& random) {
  DescriptorMatrix rows(num_rows, kSiftDescriptorDim);
  for (int i = 0; i < rows.size(); ++i) {
    rows.data()[i] = static_cast<uint8_t>(random.UniformInt(0, max_value));
  }
  return rows;
}

TEST(NearestCentre, HasTheLargestDotProductForAnyNumberOfCentres) {
  Random random(3);
  for (int num_centres = 1; num_centres <= 23; ++num_centres) {
    for (const int max_value : {1, 90, 255}) {  // 1: ties; 255: the largest sums
      const DescriptorMatrix centres = RandomRows(num_centres, max_value, random);
      const DescriptorMatrix descriptor = RandomRows(1, max_value, random);
      int expected = 0;
      int64_t largest = -1;
      for (int i = 0; i < num_centres; ++i) {
        const int64_t dot = centres.row(i).cast<int64_t>().dot(descriptor.row(0).cast<int64_t>());
        if (dot > largest) largest = dot, expected = i;
      }
      EXPECT_EQ(NearestCentre(centres.data(), num_centres, descriptor.data()), expected) << num_centres;
    }
  }
}

TEST(NearestCentre, OfValuesAroundAnOffsetHasTheLargestDotProductOfTheDifferences) {
  Random random(4);
  for (const DescriptorSpace& space : {DescriptorSpace{.num_values = 33}, DescriptorSpace{.num_values = 256},
                                       DescriptorSpace{.num_values = 128, .offset = 128},
                                       DescriptorSpace{.num_values = 64, .offset = 100}}) {
    for (int num_centres = 1; num_centres <= 9; ++num_centres) {
      std::vector<uint8_t> centres(num_centres * space.num_values), descriptor(space.num_values);
      for (uint8_t& value : centres) value = static_cast<uint8_t>(random.UniformInt(0, 255));
      for (uint8_t& value : descriptor) value = static_cast<uint8_t>(random.UniformInt(0, 255));
      // Of centres of one norm the nearest is that of the largest dot product; the
      // centre's own offset adds the same to all.
      int expected = 0;
      int64_t largest = INT64_MIN;
      for (int i = 0; i < num_centres; ++i) {
        int64_t dot = 0;
        for (int d = 0; d < space.num_values; ++d)
          dot += (centres[i * space.num_values + d] - space.offset) * (descriptor[d] - space.offset);
        if (dot > largest) largest = dot, expected = i;
      }
      EXPECT_EQ(NearestCentre(centres.data(), num_centres, descriptor.data(), space), expected);
    }
  }
}

TEST(NearestCentre, EqualCentresGiveTheFirst) {
  const DescriptorMatrix centres = DescriptorMatrix::Constant(9, kSiftDescriptorDim, 255);
  EXPECT_EQ(NearestCentre(centres.data(), 9, centres.data()), 0);
  const DescriptorMatrix black = DescriptorMatrix::Zero(6, kSiftDescriptorDim);
  EXPECT_EQ(NearestCentre(black.data(), 6, centres.data()), 0);
}

TEST(NearestCentre, SumsAndSquaredDistancesAreExact) {
  Random random(5);
  const DescriptorMatrix rows = RandomRows(7, 255, random);
  const DescriptorMatrix centre = RandomRows(1, 255, random);
  std::array<int32_t, kSiftDescriptorDim> sums = {};
  for (int i = 0; i < 7; ++i) AddDescriptor(rows.row(i).data(), kSiftDescriptorDim, sums.data());
  for (int d = 0; d < kSiftDescriptorDim; ++d) EXPECT_EQ(sums[d], rows.col(d).cast<int>().sum());
  // Nearer than before, except for the fourth.
  std::array<int32_t, 7> nearest;
  nearest.fill(INT32_MAX);
  nearest[3] = 5;
  LowerSquaredDistances(rows.data(), 7, centre.data(), kSiftDescriptorDim, nearest.data());
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(nearest[i], i == 3 ? 5 : (rows.row(i).cast<int>() - centre.row(0).cast<int>()).squaredNorm());
  }
}

}  // namespace
}  // namespace cairn
