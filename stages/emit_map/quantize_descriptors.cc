#include "stages/emit_map/quantize_descriptors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace cairn::emit_map {
namespace {

using Histogram = std::array<int64_t, 256>;

constexpr std::array<int, kMostTransformBits> kStepOfBits = {64, 32, 24, 16, 8, 4};

// The level nearest to every value, the smaller one on a tie.  REQUIRES: ascending levels
std::array<uint8_t, 256> NearestLevels(const std::vector<double>& levels) {
  std::array<uint8_t, 256> nearest = {};
  size_t level = 0;
  for (int value = 0; value < 256; ++value) {
    while (level + 1 < levels.size() && levels[level + 1] - value < value - levels[level]) ++level;
    nearest[value] = static_cast<uint8_t>(level);
  }
  return nearest;
}

// Levels between which the values lie in equal numbers.
std::vector<double> FirstLevels(const Histogram& histogram, int num_levels) {
  int64_t num_values = 0;
  for (const int64_t count : histogram) num_values += count;
  std::vector<double> levels;
  int64_t num_below = 0;
  for (int value = 0; value < 256; ++value) {
    num_below += histogram[value];
    while (static_cast<int>(levels.size()) < num_levels &&
           num_below * num_levels * 2 >= static_cast<int64_t>(2 * levels.size() + 1) * num_values) {
      levels.push_back(value);
    }
  }
  return levels;
}

}  // namespace

void QuantizeDescriptorValues(int num_bits, DescriptorMatrix* descriptors) {
  constexpr int kMaxNumRounds = 200;
  if (num_bits >= 8 || descriptors->size() == 0) return;
  Histogram histogram = {};
  for (Eigen::Index i = 0; i < descriptors->size(); ++i) ++histogram[descriptors->data()[i]];
  std::vector<double> levels = FirstLevels(histogram, 1 << num_bits);
  std::array<uint8_t, 256> nearest = NearestLevels(levels);
  for (int round = 0; round < kMaxNumRounds; ++round) {
    std::vector<int64_t> sums(levels.size(), 0), counts(levels.size(), 0);
    for (int value = 0; value < 256; ++value) {
      sums[nearest[value]] += histogram[value] * value;
      counts[nearest[value]] += histogram[value];
    }
    for (size_t level = 0; level < levels.size(); ++level) {
      if (counts[level] > 0)
        levels[level] = static_cast<double>(sums[level]) / static_cast<double>(counts[level]);
    }
    const std::array<uint8_t, 256> next = NearestLevels(levels);
    if (next == nearest) break;
    nearest = next;
  }
  for (Eigen::Index i = 0; i < descriptors->size(); ++i) {
    uint8_t& value = descriptors->data()[i];
    value = static_cast<uint8_t>(std::lround(levels[nearest[value]]));
  }
}

int TransformStep(int num_bits) { return kStepOfBits[num_bits - 1]; }

int BitsOfStep(int step) {
  const auto fine =
      std::find_if(kStepOfBits.begin(), kStepOfBits.end(), [&](int other) { return other <= step; });
  return static_cast<int>(std::min(fine, kStepOfBits.end() - 1) - kStepOfBits.begin()) + 1;
}

}  // namespace cairn::emit_map
