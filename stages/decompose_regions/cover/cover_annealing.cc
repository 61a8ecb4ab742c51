#include "stages/decompose_regions/cover/cover_annealing.h"

#include <algorithm>
#include <cmath>

namespace cairn::decompose_regions {
namespace {

// Temperatures in stations: a move that loses about this many is made now and then.
constexpr double kFirstTemperature = 4, kLastTemperature = 0.5;
// Share of the regions to exchange that are drawn from those that overlap the new one.
constexpr double kNearbyRatio = 0.7;
constexpr int64_t kExchangesAtOneTemperature = 256;

}  // namespace

CoverAnnealing::CoverAnnealing(const RegionPool& pool, const std::vector<char>& open)
    : pool_(pool),
      regions_at_(open.size()),
      place_of_(pool.size(), -1),
      counts_(open.size(), 0),
      uncovered_place_(open.size(), -1) {
  for (size_t v = 0; v < open.size(); ++v) {
    if (open[v]) open_stations_.push_back(static_cast<StationIdx>(v));
  }
  for (int region = 0; region < pool.size(); ++region) {
    for (const StationIdx station : pool[region].stations) regions_at_[station].push_back(region);
  }
}

void CoverAnnealing::Start(const std::vector<int>& start) {
  chosen_ = start;
  std::fill(place_of_.begin(), place_of_.end(), -1);
  std::fill(counts_.begin(), counts_.end(), 0);
  for (size_t i = 0; i < chosen_.size(); ++i) {
    place_of_[chosen_[i]] = static_cast<int>(i);
    for (const StationIdx station : pool_[chosen_[i]].stations) ++counts_[station];
  }
  std::fill(uncovered_place_.begin(), uncovered_place_.end(), -1);
  uncovered_.clear();
  for (const StationIdx station : open_stations_) {
    if (counts_[station] > 0) continue;
    uncovered_place_[station] = static_cast<int>(uncovered_.size());
    uncovered_.push_back(station);
  }
}

int CoverAnnealing::PlaceToExchange(int other, Random* random) const {
  if (random->Uniform() < kNearbyRatio) {
    const std::vector<StationIdx>& stations = pool_[other].stations;
    const StationIdx station = stations[random->UniformInt(0, static_cast<int64_t>(stations.size()) - 1)];
    if (counts_[station] > 0) {
      int64_t skip = random->UniformInt(0, counts_[station] - 1);
      for (const int32_t region : regions_at_[station]) {
        if (place_of_[region] >= 0 && skip-- == 0) return place_of_[region];
      }
    }
  }
  return static_cast<int>(random->UniformInt(0, static_cast<int64_t>(chosen_.size()) - 1));
}

void CoverAnnealing::Exchange(int place, int other, double temperature, Random* random) {
  const int old = chosen_[place];
  int change = 0;  // of the number of uncovered stations
  for (const auto& [begin, end] : pool_.Runs(old)) {
    for (StationIdx v = begin; v < end; ++v) change += --counts_[v] == 0;
  }
  for (const auto& [begin, end] : pool_.Runs(other)) {
    for (StationIdx v = begin; v < end; ++v) change -= counts_[v] == 0;
  }
  if (change > 0 && random->Uniform() >= std::exp(-change / temperature)) {
    for (const auto& [begin, end] : pool_.Runs(old)) {
      for (StationIdx v = begin; v < end; ++v) ++counts_[v];
    }
    return;
  }
  for (const auto& [begin, end] : pool_.Runs(other)) {
    for (StationIdx v = begin; v < end; ++v) {
      if (counts_[v]++ > 0 || uncovered_place_[v] < 0) continue;
      uncovered_place_[uncovered_.back()] = uncovered_place_[v];
      uncovered_[uncovered_place_[v]] = uncovered_.back();
      uncovered_.pop_back();
      uncovered_place_[v] = -1;
    }
  }
  for (const auto& [begin, end] : pool_.Runs(old)) {
    for (StationIdx v = begin; v < end; ++v) {
      if (counts_[v] > 0) continue;
      uncovered_place_[v] = static_cast<int>(uncovered_.size());
      uncovered_.push_back(v);
    }
  }
  place_of_[old] = -1;
  place_of_[other] = place;
  chosen_[place] = other;
}

std::vector<int> CoverAnnealing::Search(const std::vector<int>& start, int64_t num_exchanges,
                                        Random* random) {
  Start(start);
  std::vector<int> best = chosen_;
  size_t fewest = uncovered_.size();
  double temperature = kFirstTemperature;
  const int64_t num_steps = num_exchanges / kExchangesAtOneTemperature + 1;
  const double cooling = std::pow(kLastTemperature / kFirstTemperature, 1.0 / static_cast<double>(num_steps));
  for (int64_t i = 0; i < num_exchanges && fewest > 0; ++i) {
    if (i % kExchangesAtOneTemperature == 0) temperature *= cooling;
    const StationIdx station = uncovered_[random->UniformInt(0, static_cast<int64_t>(uncovered_.size()) - 1)];
    const std::vector<int32_t>& regions = regions_at_[station];
    if (regions.empty()) continue;
    const int other = regions[random->UniformInt(0, static_cast<int64_t>(regions.size()) - 1)];
    Exchange(PlaceToExchange(other, random), other, temperature, random);
    if (uncovered_.size() >= fewest) continue;
    fewest = uncovered_.size();
    best = chosen_;
  }
  return best;
}

}  // namespace cairn::decompose_regions
