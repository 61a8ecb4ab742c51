#include "core/atlas/descriptor_code.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace cairn {
namespace {

using testing::Each;
using testing::ElementsAre;

DescriptorMatrix RandomDescriptors(int num, uint64_t seed) {
  Random random(seed);
  DescriptorMatrix descriptors(num, kSiftDescriptorDim);
  for (Eigen::Index i = 0; i < descriptors.size(); ++i)
    descriptors.data()[i] = static_cast<uint8_t>(random.UniformInt(0, 90));
  return descriptors;
}

TEST(DescriptorCode, TellsTheCoefficientsThatVaryMost) {
  // All values of a descriptor together are larger or smaller: coefficient 0, the mean, and no other, varies.
  DescriptorMatrix descriptors(5, kSiftDescriptorDim);
  for (int i = 0; i < 5; ++i) descriptors.row(i).setConstant(static_cast<uint8_t>(10 * (i + 1)));
  const CodeBook book = LearnCodeBook(descriptors);
  EXPECT_EQ(book.coefficients[0], 0);
  // An orthonormal transform: sqrt(128) times the value.
  EXPECT_NEAR(book.medians[0], 30 * std::sqrt(128.0), 1);
  const DescriptorCode low = CodeOf(book, descriptors.row(0).data()),
                       high = CodeOf(book, descriptors.row(4).data());
  EXPECT_EQ(low.bits >> 31, 0);
  EXPECT_EQ(high.bits >> 31, 1);
  EXPECT_NEAR(high.margins[0], 20 * std::sqrt(128.0), 1);
  EXPECT_NEAR(low.margins[0], 20 * std::sqrt(128.0), 1);
}

TEST(DescriptorCode, AboveTheMedianABitIsOne) {
  DescriptorMatrix descriptors(5, kSiftDescriptorDim);
  for (int i = 0; i < 5; ++i) descriptors.row(i).setConstant(static_cast<uint8_t>(10 * (i + 1)));
  CodeBook book = LearnCodeBook(descriptors);
  const uint8_t* middle = descriptors.row(2).data();
  EXPECT_EQ(CodeOf(book, middle).bits >> 31, 0);
  EXPECT_EQ(CodeOf(book, middle).margins[0], 0);
  --book.medians[0];
  EXPECT_EQ(CodeOf(book, middle).bits >> 31, 1);
  EXPECT_EQ(CodeOf(book, middle).margins[0], 1);
}

TEST(DescriptorCode, HalfOfAllDescriptorsHaveEachBit) {
  const DescriptorMatrix descriptors = RandomDescriptors(1001, 1);
  const CodeBook book = LearnCodeBook(descriptors);
  std::array<int, kNumCodeBits> num_ones = {};
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    const uint32_t bits = CodeOf(book, descriptors.row(i).data()).bits;
    for (int bit = 0; bit < kNumCodeBits; ++bit) num_ones[bit] += static_cast<int>(bits >> bit & 1);
  }
  for (const int num : num_ones) EXPECT_NEAR(num, 500, 40);  // fewer where many lie on the median
}

TEST(DescriptorCode, TheOrderOfDescriptorsDoesNotMatter) {
  const DescriptorMatrix descriptors = RandomDescriptors(100, 2);
  EXPECT_EQ(LearnCodeBook(descriptors), LearnCodeBook(descriptors.colwise().reverse()));
  EXPECT_EQ(LearnCodeBook(DescriptorMatrix(0, kSiftDescriptorDim)), CodeBook());
}

TEST(DescriptorCode, CostsTheMarginsOfTheBitsThatDiffer) {
  DescriptorCode code{.bits = 0xf0000001};
  for (int bit = 0; bit < kNumCodeBits; ++bit) code.margins[bit] = static_cast<int16_t>(1 + bit);
  EXPECT_EQ(CostOf(code, code.bits), 0);
  EXPECT_EQ(CostOf(code, 0x70000001), 1);   // the highest bit
  EXPECT_EQ(CostOf(code, 0xf0000000), 32);  // the lowest
  EXPECT_EQ(CostOf(code, 0x30000000), 1 + 2 + 32);
}

TEST(DescriptorCode, FindsThePrefixesThatCostLittle) {
  DescriptorCode code{.bits = 0b1010u << 28};
  code.margins = {3, 50, 4, 6};
  // The cheapest first bit by bit: 3, 3 + 4, 4, 6, but not 3 + 6 or 4 + 6.
  EXPECT_THAT(NearPrefixes(code, 4, 8),
              testing::UnorderedElementsAre(0b1010u, 0b0010u, 0b0000u, 0b1000u, 0b1011u));
  EXPECT_EQ(NearPrefixes(code, 4, 8).front(), 0b1010u);
  EXPECT_THAT(NearPrefixes(code, 4, 2), ElementsAre(0b1010u));
  EXPECT_THAT(NearPrefixes(code, 1, 3), ElementsAre(1u, 0u));
}

TEST(DescriptorCode, PrefixesAreThoseThatCostSoMuchAtMost) {
  const DescriptorMatrix descriptors = RandomDescriptors(50, 3);
  const CodeBook book = LearnCodeBook(descriptors);
  constexpr int kBits = 10, kMaxCost = 60;
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    const DescriptorCode code = CodeOf(book, descriptors.row(i).data());
    std::vector<uint32_t> found = NearPrefixes(code, kBits, kMaxCost);
    std::sort(found.begin(), found.end());
    std::vector<uint32_t> expected;
    const uint32_t rest = code.bits & ((1u << (kNumCodeBits - kBits)) - 1);
    for (uint32_t prefix = 0; prefix < 1u << kBits; ++prefix) {
      if (CostOf(code, prefix << (kNumCodeBits - kBits) | rest) <= kMaxCost) expected.push_back(prefix);
    }
    EXPECT_EQ(found, expected);
  }
}

}  // namespace
}  // namespace cairn
