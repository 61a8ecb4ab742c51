#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace cairn {

// Order statistics.  They differ where the number of values is even; each is the one that some table was
// measured with.  REQUIRES of all: not empty.

// The smallest value that at least `part` of them do not exceed (the nearest rank): for an even number,
// Quantile(values, 0.5) is the lower of the middle two.
template <typename Allocator = std::allocator<double>>
double Quantile(std::vector<double, Allocator> values, double part) {
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(part * static_cast<double>(values.size())));
  const auto nth = values.begin() + std::clamp<std::ptrdiff_t>(rank - 1, 0, std::ssize(values) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

// The value below which this many tenths of all, rounded down, lie.  REQUIRES: tenths in [0, 9]
template <typename Allocator = std::allocator<double>>
double Decile(std::vector<double, Allocator> values, int tenths) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * tenths / 10);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The middle one; for an even number the upper of the middle two.
template <typename Allocator = std::allocator<double>>
double UpperMedian(std::vector<double, Allocator> values) {
  return Decile(std::move(values), 5);
}

// The middle one; for an even number the mean of the middle two.
template <typename Allocator = std::allocator<double>>
double Median(std::vector<double, Allocator> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

// Standard deviation of a normal distribution over its median absolute deviation.
inline constexpr double kSigmaOfMad = 1.4826;
// Standard deviation of the median of many normal values over that of their mean.
inline constexpr double kSigmaOfMedian = 1.2533;

}  // namespace cairn
