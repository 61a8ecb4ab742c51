#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>

namespace cairn {

// Adaptive binary arithmetic coding: every bit takes about -log2 of the probability that its model gives it
// [Martin, "Range encoding: an algorithm for removing redundancy from a digitised message", 1979], with
// carries as in Pavlov's LZMA.  Integers alone: the same bits give the same bytes everywhere.

// The probability of a bit, learnt from the bits coded with it so far: first their mean, later one that
// forgets.
class AdaptiveBit {
 public:
  // Of a 0, in units of 2^-15; in [32, 2^15 - 32].
  uint32_t probability_of_zero() const { return static_cast<uint32_t>(probability_) >> 1; }
  void Update(bool bit);

 private:
  int32_t probability_ = 1 << 15;  // of a 0, in units of 2^-16
  int32_t num_bits_ = 0;
};

// Encoder and decoder have the same functions, so that one function template of a Coder writes and reads: the
// decoder ignores what it is given, and both return what was coded.
class RangeEncoder {
 public:
  bool Bit(AdaptiveBit* model, bool bit);
  // Bits that nothing is known of, highest first.  REQUIRES: num_bits in [0, 63], value < 2^num_bits
  uint64_t Bits(int num_bits, uint64_t value);
  // Always true: so that code that reads can stop.
  bool ok() const { return true; }
  // All bytes.  Call once, at the end.
  std::string Take();

 private:
  void ShiftLow();

  std::string bytes_;
  uint64_t low_ = 0;
  uint32_t range_ = 0xffffffff;
  uint8_t cache_ = 0;
  uint64_t num_pending_ = 0;  // bytes that a carry may still change: the cache and so many less 1 of 0xff
  bool is_first_ = true;
};

// After a read past the end ok() is false, and what is read makes no sense.
class RangeDecoder {
 public:
  explicit RangeDecoder(std::string_view bytes);

  bool Bit(AdaptiveBit* model, bool = false);
  uint64_t Bits(int num_bits, uint64_t = 0);
  // Marks what was read as invalid.
  void Fail() { ok_ = false; }
  bool ok() const { return ok_; }
  // Whether all bytes were read and none past the end: so after everything that an encoder coded.
  bool Finished() const { return ok_ && next_ == bytes_.size(); }

 private:
  void Normalize();
  uint8_t NextByte();

  std::string_view bytes_;
  size_t next_ = 0;
  uint32_t range_ = 0xffffffff;
  uint32_t code_ = 0;
  bool ok_ = true;
};

// A symbol of few values: its bits from the highest, each with a model for the bits before it.
template <int kNumBits>
class AdaptiveSymbol {
 public:
  template <typename Coder>
  uint32_t Code(Coder& coder, uint32_t value) {
    uint32_t node = 1;
    for (int bit = kNumBits - 1; bit >= 0; --bit)
      node = 2 * node + (coder.Bit(&bits_[node], (value >> bit & 1) != 0) ? 1 : 0);
    return node - (1u << kNumBits);
  }

 private:
  std::array<AdaptiveBit, size_t{1} << kNumBits> bits_;
};

// A number of any size up to 2^48: how many bits it has, its two bits below the highest one with models, the
// others as they are: an Elias gamma code whose lengths are learnt.
class AdaptiveNumber {
 public:
  template <typename Coder>
  uint64_t Code(Coder& coder, uint64_t value) {
    constexpr int kMaxBits = 48, kNumModelled = 2;
    const int length = static_cast<int>(length_.Code(coder, static_cast<uint32_t>(std::bit_width(value))));
    if (length <= 1 || length > kMaxBits) return static_cast<uint64_t>(length == 1);
    uint64_t number = 1;
    int rest = length - 1;
    for (int i = 0; i < kNumModelled && rest > 0; ++i) {
      --rest;
      AdaptiveBit* model = &next_[static_cast<size_t>(length) * 4 + (i == 0 ? 1 : 2 + (number & 1))];
      number = 2 * number + (coder.Bit(model, (value >> rest & 1) != 0) ? 1 : 0);
    }
    return number << rest | coder.Bits(rest, value & ((uint64_t{1} << rest) - 1));
  }

 private:
  AdaptiveSymbol<6> length_;
  std::array<AdaptiveBit, 64 * 4> next_;
};

}  // namespace cairn
