#include "runtime/map/landmark_set.h"

#include <algorithm>
#include <span>

namespace cairn {

size_t LandmarkSet::Position(LandmarkIdx landmark) const {
  return std::lower_bound(idx.begin(), idx.end(), landmark) - idx.begin();
}

int NumShared(std::span<const LandmarkIdx> a, std::span<const LandmarkIdx> b) {
  int num_shared = 0;
  for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    num_shared += a[i] == b[j] ? 1 : 0;
    const bool next_a = a[i] <= b[j], next_b = b[j] <= a[i];
    i += next_a ? 1 : 0;
    j += next_b ? 1 : 0;
  }
  return num_shared;
}

}  // namespace cairn
