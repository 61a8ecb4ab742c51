#pragma once

#include <algorithm>
#include <utility>
#include <vector>

namespace cairn {

// The value that so many tenths of all, rounded down, lie below.  REQUIRES: not empty, tenths in [0, 9]
inline double Decile(std::vector<double> values, int tenths) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * tenths / 10);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The middle one; of an even number the upper of the middle two.  REQUIRES: not empty
inline double Median(std::vector<double> values) { return Decile(std::move(values), 5); }

}  // namespace cairn
