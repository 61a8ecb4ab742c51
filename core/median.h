#pragma once

#include <algorithm>
#include <vector>

namespace cairn {

// The middle one; of an even number the upper of the middle two.  REQUIRES: not empty
inline double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace cairn
