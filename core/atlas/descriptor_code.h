#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/features/features.h"

namespace cairn {

inline constexpr int kNumCodeBits = 32;

// Which coefficients of a descriptor's cosine transform (core/features/transform_code.h) its code tells, that
// of the highest bit first: those that vary most; and the value above which a bit is 1, so that half of all
// descriptors have it.
struct CodeBook {
  std::array<uint8_t, kNumCodeBits> coefficients = {};
  std::array<int16_t, kNumCodeBits> medians = {};
  friend bool operator==(const CodeBook&, const CodeBook&) = default;
};
// Of many descriptors; of none: all zero.  Same descriptors in any order, same book.
CodeBook LearnCodeBook(const DescriptorMatrix& descriptors);

// A descriptor as the code of the landmark that it may show, and how far each bit is from being another.
struct DescriptorCode {
  uint32_t bits = 0;
  std::array<int16_t, kNumCodeBits> margins =
      {};  // distances from the medians, that of the highest bit first
};
DescriptorCode CodeOf(const CodeBook& book, const uint8_t* descriptor);

// Sum of the margins of the bits that another code has otherwise: the less, the likelier both are of one
// landmark.  Two sightings of a landmark differ by some 20 in each coefficient.
int CostOf(const DescriptorCode& code, uint32_t other);

// The codes of the highest `num_bits` bits that cost no more than `max_cost`, the cheapest (its own) first.
// REQUIRES: 0 < num_bits <= kNumCodeBits
std::vector<uint32_t> NearPrefixes(const DescriptorCode& code, int num_bits, int max_cost);

}  // namespace cairn
