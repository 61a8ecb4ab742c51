#include "core/packing/range_coder.h"

#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

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
