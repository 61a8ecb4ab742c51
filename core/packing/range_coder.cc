#include "core/packing/range_coder.h"

#include <algorithm>

namespace cairn {
namespace {

constexpr int kProbabilityBits = 15;
constexpr uint32_t kSmallestRange = 1u << 24;  // below it a byte is shifted out
// A model is the mean of so many bits; then older ones count less and less.
constexpr int32_t kMaxNumBits = 250;

}  // namespace

void AdaptiveBit::Update(bool bit) {
  num_bits_ = std::min(num_bits_ + 1, kMaxNumBits);
  // (target - probability) / (num_bits + 1/2): the estimator of Krichevsky and Trofimov, 1981.
  const int32_t target = bit ? 0 : 1 << 16;
  // It ends 2^16 / (2 * 250 + 2) away from the target or farther, as steps are rounded to 0.
  probability_ += 2 * (target - probability_) / (2 * num_bits_ + 1);
}

bool RangeEncoder::Bit(AdaptiveBit* model, bool bit) {
  const uint32_t bound = (range_ >> kProbabilityBits) * model->probability_of_zero();
  if (bit) {
    low_ += bound;
    range_ -= bound;
  } else {
    range_ = bound;
  }
  for (; range_ < kSmallestRange; range_ <<= 8) ShiftLow();
  model->Update(bit);
  return bit;
}

uint64_t RangeEncoder::Bits(int num_bits, uint64_t value) {
  for (int bit = num_bits - 1; bit >= 0; --bit) {
    range_ >>= 1;
    if ((value >> bit & 1) != 0) low_ += range_;
    for (; range_ < kSmallestRange; range_ <<= 8) ShiftLow();
  }
  return value;
}

void RangeEncoder::ShiftLow() {
  const bool has_carry = low_ > 0xffffffff;
  if (has_carry || static_cast<uint32_t>(low_) < 0xff000000) {
    // The first byte is always 0 and is not stored.
    if (!is_first_) bytes_.push_back(static_cast<char>(cache_ + (has_carry ? 1 : 0)));
    is_first_ = false;
    for (; num_pending_ > 0; --num_pending_) bytes_.push_back(static_cast<char>(has_carry ? 0x00 : 0xff));
    cache_ = static_cast<uint8_t>(low_ >> 24);
  } else {
    ++num_pending_;
  }
  low_ = (low_ & 0x00ffffff) << 8;
}

std::string RangeEncoder::Take() {
  constexpr int kBytesOfLow = 5;
  for (int i = 0; i < kBytesOfLow; ++i) ShiftLow();
  return std::move(bytes_);
}

RangeDecoder::RangeDecoder(std::string_view bytes) : bytes_(bytes) {
  for (int i = 0; i < 4; ++i) code_ = code_ << 8 | NextByte();
}

uint8_t RangeDecoder::NextByte() {
  if (next_ == bytes_.size()) {
    ok_ = false;
    return 0;
  }
  return static_cast<uint8_t>(bytes_[next_++]);
}

void RangeDecoder::Normalize() {
  for (; range_ < kSmallestRange; range_ <<= 8) code_ = code_ << 8 | NextByte();
}

bool RangeDecoder::Bit(AdaptiveBit* model, bool) {
  const uint32_t bound = (range_ >> kProbabilityBits) * model->probability_of_zero();
  const bool bit = code_ >= bound;
  if (bit) {
    code_ -= bound;
    range_ -= bound;
  } else {
    range_ = bound;
  }
  Normalize();
  model->Update(bit);
  return bit;
}

uint64_t RangeDecoder::Bits(int num_bits, uint64_t) {
  uint64_t value = 0;
  for (int bit = 0; bit < num_bits; ++bit) {
    range_ >>= 1;
    const bool is_one = code_ >= range_;
    if (is_one) code_ -= range_;
    value = value << 1 | (is_one ? 1 : 0);
    Normalize();
  }
  return value;
}

}  // namespace cairn
