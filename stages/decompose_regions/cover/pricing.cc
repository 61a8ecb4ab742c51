#include "stages/decompose_regions/cover/pricing.h"

#include <algorithm>
#include <utility>

namespace cairn::decompose_regions {

RegionPricer::RegionPricer(const ReducedWorld& wide)
    : wide_(wide), finder_(wide), sums_(wide.areas.size(), 0) {}

int64_t RegionPricer::Value(const std::vector<StationIdx>& stations) const {
  int64_t value = 0;
  for (const StationIdx station : stations) value += (*values_)[station];
  return value;
}

// Features worth more than the threshold, those of little value first: they have few partners, and those of
// large value then have few features left to combine with.
std::vector<int32_t> RegionPricer::OrderFeatures(int64_t threshold) {
  const int num_features = wide_.areas.size();
  std::vector<int64_t> totals(num_features, 0);
  std::vector<int32_t> order;
  std::vector<StationIdx> live;
  live_areas_ = IndexLists();
  for (int32_t feature = 0; feature < num_features; ++feature) {
    live.clear();
    for (const StationIdx station : wide_.areas[feature]) {
      if ((*values_)[station] > 0) live.push_back(station);
    }
    totals[feature] = Value(live);
    if (totals[feature] > threshold) {
      order.push_back(feature);
    } else {
      live.clear();
    }
    live_areas_.Append(live);
  }
  live_sets_ = live_areas_.Transposed(wide_.num_stations());
  std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return totals[a] < totals[b]; });
  return order;
}

void RegionPricer::Greedy(const StationValues& values, int64_t threshold, std::vector<CoreRegion>* found) {
  values_ = &values;
  std::vector<StationIdx> removed;
  for (const int32_t first : OrderFeatures(threshold)) {
    std::vector<StationIdx> stations(live_areas_[first].begin(), live_areas_[first].end());
    int64_t value = Value(stations);
    for (const StationIdx station : stations) {
      for (const int32_t feature : live_sets_[station]) {
        if (sums_[feature] == 0) touched_.push_back(feature);
        sums_[feature] += values[station];
      }
    }
    std::vector<int32_t> features = {first}, candidates;
    for (const int32_t feature : touched_) {
      if (feature != first) candidates.push_back(feature);
    }
    while (static_cast<int>(features.size()) < wide_.k) {
      // Sums only fall: a feature that keeps too little is no candidate any more.
      std::erase_if(candidates, [&](int32_t feature) { return sums_[feature] <= threshold; });
      if (candidates.empty()) break;
      const auto largest = std::min_element(candidates.begin(), candidates.end(), [&](int32_t a, int32_t b) {
        return std::pair(-sums_[a], a) < std::pair(-sums_[b], b);
      });
      const int32_t best = *largest;
      *largest = candidates.back();
      candidates.pop_back();
      features.push_back(best);
      if (sums_[best] == value) continue;
      value = sums_[best];
      removed.clear();
      KeepCommon(live_areas_[best], &stations, &removed);
      for (const StationIdx station : removed) {
        for (const int32_t feature : live_sets_[station]) sums_[feature] -= values[station];
      }
    }
    for (const int32_t feature : touched_) sums_[feature] = 0;
    touched_.clear();
    if (static_cast<int>(features.size()) < wide_.k) continue;
    std::sort(features.begin(), features.end());
    for (std::vector<StationIdx>& core : finder_.Cores(features)) {
      if (Value(core) > threshold) found->push_back({features, std::move(core)});
    }
  }
}

}  // namespace cairn::decompose_regions
