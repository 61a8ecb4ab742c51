#pragma once

#include <algorithm>
#include <cstdint>
#include <set>
#include <vector>

#include "core/world/world.h"

namespace cairn::decompose_regions {

// Every region of a small world by the definitions [Sala06 §III] alone, by trying all sets of k features: the
// oracle that bounds and decompositions are held against.  Sets of stations are bit masks.
// REQUIRES: at most 16 stations
class AllRegions {
 public:
  AllRegions(const World& world, int k, int tau)
      : num_stations_(world.num_stations()), neighbours_(num_stations_, 0) {
    for (const auto& [u, v] : world.edges) {
      neighbours_[u] |= Bit(v);
      neighbours_[v] |= Bit(u);
    }
    for (const std::vector<StationIdx>& area : world.areas) {
      uint32_t mask = 0;
      for (const StationIdx station : area) mask |= Bit(station);
      areas_.push_back(mask);
    }
    for (int v = 0; v < num_stations_; ++v) {
      uint32_t ball = Bit(v);
      for (int hop = 0; hop < tau; ++hop) ball = Neighbourhood(ball);
      balls_.push_back(ball);
      const auto sees_all = [&](uint32_t area) { return (ball & ~area) == 0; };
      if (std::count_if(areas_.begin(), areas_.end(), sees_all) >= k) coverable_ |= Bit(v);
    }
    Choose(k, 0, Bit(num_stations_) - 1);
  }

  // Per region that is not contained in another of the same features: the coverable stations whose
  // tau-neighbourhood lies in it.
  const std::set<uint32_t>& covers() const { return covers_; }
  // Fewest regions that leave at most `max_uncovered` coverable stations uncovered.
  int Fewest(int max_uncovered) const {
    std::set<uint32_t> reached = {0};
    for (int num_regions = 0;; ++num_regions) {
      for (const uint32_t covered : reached) {
        if (__builtin_popcount(coverable_ & ~covered) <= max_uncovered) return num_regions;
      }
      std::set<uint32_t> next;
      for (const uint32_t covered : reached) {
        for (const uint32_t cover : covers_) next.insert(covered | cover);
      }
      reached = std::move(next);
    }
  }

 private:
  static uint32_t Bit(int station) { return uint32_t{1} << station; }
  uint32_t Neighbourhood(uint32_t stations) const {
    uint32_t reached = stations;
    for (int v = 0; v < num_stations_; ++v) {
      if (stations & Bit(v)) reached |= neighbours_[v];
    }
    return reached;
  }
  void Choose(int num_missing, size_t first_feature, uint32_t common) {
    if (num_missing == 0) {
      AddComponents(common);
      return;
    }
    for (size_t feature = first_feature; feature < areas_.size(); ++feature) {
      Choose(num_missing - 1, feature + 1, common & areas_[feature]);
    }
  }
  void AddComponents(uint32_t stations) {
    while (stations != 0) {
      uint32_t region = stations & -stations;
      for (uint32_t grown = 0; grown != region;) {
        grown = region;
        region = Neighbourhood(region) & stations;
      }
      stations &= ~region;
      uint32_t cover = 0;
      for (int v = 0; v < num_stations_; ++v) {
        if ((coverable_ & Bit(v)) && (balls_[v] & ~region) == 0) cover |= Bit(v);
      }
      if (cover != 0) covers_.insert(cover);
    }
  }

  const int num_stations_;
  std::vector<uint32_t> neighbours_, areas_, balls_;
  uint32_t coverable_ = 0;
  std::set<uint32_t> covers_;
};

}  // namespace cairn::decompose_regions
