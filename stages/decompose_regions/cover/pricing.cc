#include "stages/decompose_regions/cover/pricing.h"

#include <algorithm>
#include <numeric>

namespace cairn::decompose_regions {

RegionPricer::RegionPricer(const ReducedWorld& wide)
    : wide_(wide), finder_(wide), sums_(wide.areas.size(), 0), rank_(wide.areas.size(), 0) {}

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
  for (size_t i = 0; i < order.size(); ++i) rank_[order[i]] = static_cast<int32_t>(i);
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
    std::vector<int32_t> features = {first};
    while (static_cast<int>(features.size()) < wide_.k) {
      int32_t best = -1;
      for (const int32_t feature : touched_) {
        if (best >= 0 && (sums_[feature] < sums_[best] || (sums_[feature] == sums_[best] && feature >= best)))
          continue;
        if (std::find(features.begin(), features.end(), feature) == features.end()) best = feature;
      }
      if (best < 0 || sums_[best] <= threshold) break;
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

// Features after `rank` that keep more than the threshold of the stations' value, by rank.
std::vector<RegionPricer::Candidate> RegionPricer::Candidates(const std::vector<StationIdx>& stations,
                                                              int32_t rank) {
  for (const StationIdx station : stations) {
    const int64_t value = (*values_)[station];
    work_left_ -= static_cast<int64_t>(live_sets_[station].size());
    for (const int32_t feature : live_sets_[station]) {
      if (sums_[feature] == 0) touched_.push_back(feature);
      sums_[feature] += value;
    }
  }
  std::vector<Candidate> candidates;
  for (const int32_t feature : touched_) {
    if (sums_[feature] > threshold_ && rank_[feature] > rank) candidates.push_back({feature, sums_[feature]});
    sums_[feature] = 0;
  }
  touched_.clear();
  std::sort(candidates.begin(), candidates.end(),
            [&](const Candidate& a, const Candidate& b) { return rank_[a.feature] < rank_[b.feature]; });
  return candidates;
}

int64_t RegionPricer::MaxValue(const StationValues& values, int64_t threshold, int64_t max_work,
                               size_t max_found, std::vector<CoreRegion>* found) {
  values_ = &values;
  threshold_ = max_value_ = threshold;
  work_left_ = max_work;
  max_found_ = max_found;
  found_ = found;
  for (const int32_t feature : OrderFeatures(threshold)) {
    if (wide_.k == 1) {
      CloseLeaf({feature});
      continue;
    }
    const std::vector<StationIdx> stations(live_areas_[feature].begin(), live_areas_[feature].end());
    std::vector<Candidate> candidates = Candidates(stations, rank_[feature]);
    if (static_cast<int>(candidates.size()) < wide_.k - 1) continue;
    if (work_left_ > 0) {
      chosen_ = {feature};
      Search(stations, candidates);
    }
    if (work_left_ <= 0) {
      std::nth_element(candidates.begin(), candidates.begin() + (wide_.k - 2), candidates.end(),
                       [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
      max_value_ = std::max(max_value_, candidates[wide_.k - 2].value);
    }
  }
  return max_value_;
}

// Extends the chosen features by one candidate after the other.
// REQUIRES: the candidates are ordered by rank.
void RegionPricer::Search(const std::vector<StationIdx>& stations, const std::vector<Candidate>& candidates) {
  const size_t num_missing = wide_.k - chosen_.size();
  for (size_t i = 0; i + num_missing <= candidates.size(); ++i) {
    if (work_left_ <= 0) return;
    chosen_.push_back(candidates[i].feature);
    if (num_missing == 1) {
      CloseLeaf(chosen_);
    } else {
      std::vector<StationIdx> narrowed;
      const auto area = live_areas_[candidates[i].feature];
      std::set_intersection(stations.begin(), stations.end(), area.begin(), area.end(),
                            std::back_inserter(narrowed));
      const std::vector<Candidate> next = Candidates(narrowed, rank_[candidates[i].feature]);
      if (next.size() >= num_missing - 1) Search(narrowed, next);
    }
    chosen_.pop_back();
  }
}

void RegionPricer::CloseLeaf(std::vector<int32_t> features) {
  std::sort(features.begin(), features.end());
  for (const int32_t feature : features) work_left_ -= static_cast<int64_t>(wide_.areas[feature].size());
  for (std::vector<StationIdx>& core : finder_.Cores(features)) {
    const int64_t value = Value(core);
    if (value <= threshold_) continue;
    max_value_ = std::max(max_value_, value);
    if (found_->size() < max_found_) found_->push_back({features, std::move(core)});
  }
}

}  // namespace cairn::decompose_regions
