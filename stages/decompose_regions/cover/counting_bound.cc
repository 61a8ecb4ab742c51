#include "stages/decompose_regions/cover/counting_bound.h"

#include <algorithm>
#include <functional>

namespace cairn::decompose_regions {

int CountingBound(const ReducedWorld& reduced, int max_uncovered) {
  // Components of one feature's area count together: a region may cover stations in several.
  FeatureIdx num_features = 0;
  for (const FeatureIdx feature : reduced.original) num_features = std::max(num_features, feature + 1);
  std::vector<int> num_stations(num_features, 0);
  for (int32_t i = 0; i < reduced.areas.size(); ++i) {
    num_stations[reduced.original[i]] += static_cast<int>(reduced.areas[i].size());
  }
  // y_v as multiples of 2^-32, rounded down.
  constexpr int64_t kOne = int64_t{1} << 32;
  std::vector<int64_t> values;
  std::vector<int> counts;
  for (StationIdx station = 0; station < reduced.num_stations(); ++station) {
    if (!reduced.coverable[station]) continue;
    counts.clear();
    for (const int32_t feature : reduced.sets[station])
      counts.push_back(num_stations[reduced.original[feature]]);
    std::nth_element(counts.begin(), counts.begin() + (reduced.k - 1), counts.end(), std::greater<>());
    values.push_back(kOne / counts[reduced.k - 1]);
  }
  std::sort(values.begin(), values.end(), std::greater<>());
  int64_t sum = 0;
  for (size_t i = max_uncovered; i < values.size(); ++i) sum += values[i];
  return static_cast<int>((sum + kOne - 1) / kOne);
}

}  // namespace cairn::decompose_regions
