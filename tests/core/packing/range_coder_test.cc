#include "core/packing/range_coder.h"

#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/packing/page_decoder.h"

namespace cairn {
namespace {

TEST(RangeCoder, WhatWasWrittenIsReadAndNothingIsLeft) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    const auto num = static_cast<int>(random.UniformInt(0, 300));
    std::vector<uint64_t> numbers;
    for (int i = 0; i < num; ++i)
      numbers.push_back(random.UniformInt(0, (uint64_t{1} << random.UniformInt(0, 47)) - 1));
    RangeEncoder encoder;
    AdaptiveNumber wrote;
    AdaptiveBit bit_wrote;
    AdaptiveSymbol<5> symbol_wrote;
    for (const uint64_t number : numbers) {
      wrote.Code(encoder, number);
      encoder.Bit(&bit_wrote, number % 2 == 1);
      symbol_wrote.Code(encoder, number % 32);
      encoder.Bits(7, number % 128);
    }
    const std::string bytes = encoder.Take();
    RangeDecoder decoder(bytes);
    AdaptiveNumber read;
    AdaptiveBit bit_read;
    AdaptiveSymbol<5> symbol_read;
    for (const uint64_t number : numbers) {
      ASSERT_EQ(read.Code(decoder, 0), number);
      ASSERT_EQ(decoder.Bit(&bit_read), number % 2 == 1);
      ASSERT_EQ(symbol_read.Code(decoder, 0), number % 32);
      ASSERT_EQ(decoder.Bits(7), number % 128);
    }
    EXPECT_TRUE(decoder.Finished());
    if (!bytes.empty()) {
      RangeDecoder cut(std::string_view(bytes).substr(0, bytes.size() - 1));
      AdaptiveNumber again;
      AdaptiveBit bit_again;
      AdaptiveSymbol<5> symbol_again;
      for (int i = 0; i < num; ++i) {
        again.Code(cut, 0);
        cut.Bit(&bit_again);
        symbol_again.Code(cut, 0);
        cut.Bits(7);
      }
      EXPECT_FALSE(cut.Finished());
    }
  }
}

// Models that meet only zeros, only ones, and either for a long time, so that they come to count their last
// 250 bits.
TEST(RangeCoder, BitsAreThoseThatThePageDraws) {
  Random random(3);
  const double shares[] = {0, 1, 0.02, 0.3, 0.99};
  RangeEncoder encoder;
  AdaptiveBit models[5];
  std::vector<std::vector<bool>> bits(5);
  for (int i = 0; i < 3000; ++i) {
    for (int k = 0; k < 5; ++k) {
      // In the middle all of them change.
      bits[k].push_back(random.Uniform() < (i > 1500 && i < 1700 ? 1 - shares[k] : shares[k]));
      encoder.Bit(&models[k], bits[k].back());
    }
    encoder.Bits(3, static_cast<uint64_t>(i) % 8);
  }
  const std::string bytes = encoder.Take();
  PageDecoder page(bytes);
  for (int i = 0; i < 3000; ++i) {
    for (int k = 0; k < 5; ++k) ASSERT_EQ(page.Bit("", {k}), bits[k][i]) << i << ' ' << k;
    ASSERT_EQ(page.Bits(3), static_cast<uint64_t>(i) % 8);
  }
  EXPECT_TRUE(page.IsAtEnd());
}

// By hand: after n zeros a 1 has 1 / (2 n + 2) as by Krichevsky and Trofimov, rounded, and never less than
// 2^-10.
TEST(RangeCoder, ProbabilitiesStayWithinTheirLimits) {
  for (const bool bit : {false, true}) {
    AdaptiveBit model;
    const auto other = [&] {
      return bit ? model.probability_of_zero() : 32768 - model.probability_of_zero();
    };
    EXPECT_EQ(other(), 16384u);
    model.Update(bit);
    EXPECT_NEAR(other(), 32768 / 6.0, 2);  // 1/2 - 2/3 of 1/2
    for (int i = 0; i < 1000; ++i) model.Update(bit);
    EXPECT_GE(other(), 65u);  // 1 / (2 * 250 + 2) of 2^15; steps are rounded to 0 before that
    EXPECT_LE(other(), 75u);
  }
}

// Bits that are 1 with probability p take about their entropy, -p log2 p - (1 - p) log2 (1 - p).
TEST(RangeCoder, BitsTakeTheirEntropy) {
  for (const double p : {0.5, 0.1, 0.01}) {
    Random random(2);
    RangeEncoder encoder;
    AdaptiveBit model;
    constexpr int kNumBits = 40000;
    for (int i = 0; i < kNumBits; ++i) encoder.Bit(&model, random.Uniform(0, 1) < p);
    const double entropy = -p * std::log2(p) - (1 - p) * std::log2(1 - p);
    EXPECT_NEAR(static_cast<double>(encoder.Take().size()) * 8 / kNumBits, entropy, 0.03 * entropy + 0.004);
  }
}

// A carry runs through bytes of 0xff: a long stretch of the upper part of the range, then a little more.
TEST(RangeCoder, CarriesRunThroughFullBytes) {
  for (int num_ones = 0; num_ones < 80; ++num_ones) {
    RangeEncoder encoder;
    AdaptiveBit model;
    encoder.Bits(1, 0);
    for (int i = 0; i < num_ones; ++i) encoder.Bits(1, 1);
    for (int i = 0; i < 40; ++i) encoder.Bit(&model, true);
    const std::string bytes = encoder.Take();
    RangeDecoder decoder(bytes);
    AdaptiveBit same;
    EXPECT_EQ(decoder.Bits(1), 0u);
    for (int i = 0; i < num_ones; ++i) ASSERT_EQ(decoder.Bits(1), 1u) << num_ones;
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(decoder.Bit(&same)) << num_ones;
    EXPECT_TRUE(decoder.Finished());
  }
}

// By hand: nothing coded is the range's beginning, four bytes of 0.  A 1 of an even model takes the range's
// upper half, from 0x7fff8000 = (0xffffffff >> 15) * 2^14 on.
TEST(RangeCoder, ExactBytes) {
  EXPECT_EQ(RangeEncoder().Take(), std::string(4, '\0'));
  RangeEncoder encoder;
  AdaptiveBit model;
  encoder.Bit(&model, true);
  EXPECT_EQ(encoder.Take(), std::string("\x7f\xff\xc0\x00", 4));
}

}  // namespace
}  // namespace cairn
