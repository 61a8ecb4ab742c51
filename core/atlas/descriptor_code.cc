#include "core/atlas/descriptor_code.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "core/features/transform_code.h"

namespace cairn {
namespace {

// Coefficients in units of a descriptor's values.
constexpr TransformCode kUnitSteps{.step = 1};

}  // namespace

CodeBook LearnCodeBook(const DescriptorMatrix& descriptors) {
  CodeBook book;
  const Eigen::Index num = descriptors.rows();
  if (num == 0) return book;
  std::vector<std::vector<int16_t>> values(kSiftDescriptorDim,
                                           std::vector<int16_t>(static_cast<size_t>(num)));
  for (Eigen::Index row = 0; row < num; ++row) {
    const TransformLevels levels = LevelsOf(descriptors.data() + row * kSiftDescriptorDim, kUnitSteps);
    for (size_t c = 0; c < levels.size(); ++c) values[c][static_cast<size_t>(row)] = levels[c];
  }
  std::array<int64_t, kSiftDescriptorDim> spread;  // sum of squared distances from the median
  for (size_t c = 0; c < values.size(); ++c) {
    const auto middle = values[c].begin() + num / 2;
    std::nth_element(values[c].begin(), middle, values[c].end());
    const int64_t median = *middle;
    spread[c] = std::accumulate(
        values[c].begin(), values[c].end(), int64_t{0},
        [&](int64_t sum, int16_t value) { return sum + (value - median) * (value - median); });
    std::swap(*middle, values[c].front());
  }
  std::array<uint8_t, kSiftDescriptorDim> order;
  std::iota(order.begin(), order.end(), uint8_t{0});
  std::stable_sort(order.begin(), order.end(), [&](uint8_t a, uint8_t b) { return spread[a] > spread[b]; });
  for (size_t bit = 0; bit < kNumCodeBits; ++bit) {
    book.coefficients[bit] = order[bit];
    book.medians[bit] = values[order[bit]].front();
  }
  return book;
}

DescriptorCode CodeOf(const CodeBook& book, const uint8_t* descriptor) {
  const TransformLevels levels = LevelsOf(descriptor, kUnitSteps);
  DescriptorCode code;
  for (size_t bit = 0; bit < kNumCodeBits; ++bit) {
    const int difference = levels[book.coefficients[bit]] - book.medians[bit];
    code.bits = code.bits << 1 | (difference > 0 ? 1 : 0);
    code.margins[bit] = static_cast<int16_t>(std::abs(difference));
  }
  return code;
}

int CostOf(const DescriptorCode& code, uint32_t other) {
  int cost = 0;
  const uint32_t differing = code.bits ^ other;
  for (size_t bit = 0; bit < kNumCodeBits; ++bit) {
    if ((differing >> (kNumCodeBits - 1 - bit) & 1) != 0) cost += code.margins[bit];
  }
  return cost;
}

std::vector<uint32_t> NearPrefixes(const DescriptorCode& code, int num_bits, int max_cost) {
  std::vector<int> order(static_cast<size_t>(num_bits));  // cheapest bit first
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return code.margins[a] < code.margins[b]; });
  struct Prefix {
    uint32_t bits;
    int cost;
    size_t next;  // bits of `order` from here on may still be turned
  };
  std::vector<Prefix> found = {{code.bits >> (kNumCodeBits - num_bits), 0, 0}};
  for (size_t i = 0; i < found.size(); ++i) {
    for (size_t k = found[i].next; k < order.size(); ++k) {
      const int cost = found[i].cost + code.margins[order[k]];
      if (cost > max_cost) break;
      found.push_back({found[i].bits ^ uint32_t{1} << (num_bits - 1 - order[k]), cost, k + 1});
    }
  }
  std::vector<uint32_t> prefixes;
  for (const Prefix& prefix : found) prefixes.push_back(prefix.bits);
  return prefixes;
}

}  // namespace cairn
