// [Sala06 Fig. 4, Fig. 5] Lines 3-9 and 7-13: shrinking a region until k features are visible all over it;
// B.1, B.2 and C do it.
#include <algorithm>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {

FeatureChooser::FeatureChooser(Cover* cover) : cover_(*cover), counts_(cover->world().areas.size(), 0) {}

void FeatureChooser::Count(const std::vector<StationIdx>& stations) {
  for (const StationIdx station : stations) {
    for (const int32_t feature : cover_.world().sets[station]) {
      if (counts_[feature]++ == 0) counted_.push_back(feature);
    }
  }
}

void FeatureChooser::Uncount(const std::vector<StationIdx>& stations) {
  for (const StationIdx station : stations) {
    for (const int32_t feature : cover_.world().sets[station]) --counts_[feature];
  }
}

// [Sala06 Fig. 4 line 5, Fig. 5 line 9] f = argmax over f in F \ L (C: Phi \ L) of |{v in R : f in F_v}|
int32_t FeatureChooser::MostVisible(const std::vector<int32_t>* allowed,
                                    const std::vector<int32_t>& chosen) const {
  int32_t best = -1;
  for (const int32_t feature : allowed ? *allowed : counted_) {
    const int32_t count = counts_[feature];
    if (best >= 0 && (count < counts_[best] || (count == counts_[best] && feature > best))) continue;
    if (std::find(chosen.begin(), chosen.end(), feature) == chosen.end()) best = feature;
  }
  return best;
}

CoreRegion FeatureChooser::Choose(const std::vector<int32_t>* allowed) {
  const ReducedWorld& world = cover_.world();
  // [Sala06 Fig. 4 line 3, Fig. 5 line 7] R = U, L = {}; the first feature is known from the counts over U
  CoreRegion region;
  if (allowed) {
    region.features.push_back(*std::max_element(allowed->begin(), allowed->end(), [&](int32_t a, int32_t b) {
      return std::pair(cover_.OpenCount(a), -a) < std::pair(cover_.OpenCount(b), -b);
    }));
  } else {
    region.features.push_back(cover_.MostVisibleFeature());
  }
  std::vector<StationIdx> stations, removed;
  for (const StationIdx station : world.areas[region.features[0]]) {
    if (cover_.IsOpen(station)) stations.push_back(station);
  }
  if (world.k > 1) Count(stations);
  // [Sala06 Fig. 4 line 4, Fig. 5 line 8] for i = 1 to k
  while (static_cast<int>(region.features.size()) < world.k) {
    const int32_t feature = MostVisible(allowed, region.features);
    region.features.push_back(feature);  // [Sala06 Fig. 4 line 7, Fig. 5 line 11] L = L u {f}
    if (counts_[feature] == static_cast<int32_t>(stations.size())) continue;  // R stays
    // [Sala06 Fig. 4 line 6, Fig. 5 line 10] R = {v in R : f in F_v}
    removed.clear();
    KeepCommon(world.areas[feature], &stations, &removed);
    if (removed.size() <= stations.size()) {
      Uncount(removed);
    } else {
      for (const int32_t f : counted_) counts_[f] = 0;
      counted_.clear();
      Count(stations);
    }
  }
  for (const int32_t feature : counted_) counts_[feature] = 0;
  counted_.clear();

  // [Sala06 Fig. 4 line 9, Fig. 5 line 13] R = {v in V : L is a subset of F_v}
  region.stations = CommonStations(world.areas, region.features);
  return region;
}

}  // namespace cairn::decompose_regions
