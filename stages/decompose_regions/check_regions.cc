#include "stages/decompose_regions/check_regions.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace cairn::decompose_regions {
namespace {

using StationSet = std::vector<StationIdx>;

class Checker {
 public:
  Checker(const World& world, const Decomposition& decomposition)
      : world_(world),
        decomposition_(decomposition),
        neighbours_(AdjacencyLists(world)),
        sets_(VisibilitySets(world)) {}

  RegionCheck Check(int max_hole) {
    if (!CheckIndices()) return check_;
    for (size_t i = 0; i < decomposition_.regions.size(); ++i) CheckRegion(static_cast<int>(i));
    CheckCoverage();
    CheckRedundancy();
    CheckBound();
    StationSet hole = uncovered_;
    while (!hole.empty()) {
      const StationSet part = ReachableFrom(hole[0], hole);
      check_.largest_hole = std::max(check_.largest_hole, static_cast<int>(part.size()));
      StationSet rest;
      std::set_difference(hole.begin(), hole.end(), part.begin(), part.end(), std::back_inserter(rest));
      hole = rest;
    }
    if (max_hole >= 0 && check_.largest_hole > max_hole) {
      Fail("a hole of {} connected uncovered stations is larger than {}", check_.largest_hole, max_hole);
    }
    return check_;
  }

 private:
  template <typename... Args>
  void Fail(fmt::format_string<Args...> format, Args&&... args) {
    check_.violations.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  void CheckList(const std::vector<int32_t>& list, int limit, const std::string& what) {
    for (size_t i = 0; i < list.size(); ++i) {
      if (list[i] < 0 || list[i] >= limit) {
        Fail("{}: {} is outside of 0 to {}", what, list[i], limit - 1);
      } else if (i > 0 && list[i - 1] >= list[i]) {
        Fail("{}: {} is a duplicate or out of order", what, list[i]);
      }
    }
  }
  bool CheckIndices() {
    if (decomposition_.k < 1) Fail("k = {} is not positive", decomposition_.k);
    if (decomposition_.tau < 0) Fail("tau = {} is negative", decomposition_.tau);
    for (size_t i = 0; i < decomposition_.regions.size(); ++i) {
      const Region& region = decomposition_.regions[i];
      CheckList(region.stations, world_.num_stations(), fmt::format("region {}: station", i));
      CheckList(region.features, world_.num_features(), fmt::format("region {}: feature", i));
      if (region.stations.empty()) Fail("region {} has no station", i);
    }
    CheckList(decomposition_.uncovered, world_.num_stations(), "uncovered station");
    return check_.violations.empty();
  }

  // Stations of `within` (ascending) that a path inside of it joins to `start`, ascending.
  StationSet ReachableFrom(StationIdx start, const StationSet& within) const {
    std::vector<bool> inside(world_.num_stations(), false);
    for (const StationIdx station : within) inside[station] = true;
    StationSet reached = {start};
    inside[start] = false;
    for (size_t i = 0; i < reached.size(); ++i) {
      for (const StationIdx next : neighbours_[reached[i]]) {
        if (!inside[next]) continue;
        inside[next] = false;
        reached.push_back(next);
      }
    }
    std::sort(reached.begin(), reached.end());
    return reached;
  }

  // [Sala06 Def. 3.6] N_tau(v), by breadth-first search.
  StationSet Neighbourhood(StationIdx center) const {
    StationSet stations = {center};
    size_t begin = 0;
    for (int hop = 0; hop < decomposition_.tau && begin < stations.size(); ++hop) {
      const size_t end = stations.size();
      for (; begin < end; ++begin) {
        for (const StationIdx next : neighbours_[stations[begin]]) {
          if (!visited_[next] && next != center) {
            visited_[next] = true;
            stations.push_back(next);
          }
        }
      }
    }
    for (const StationIdx station : stations) visited_[station] = false;
    std::sort(stations.begin(), stations.end());
    return stations;
  }

  void CheckRegion(int idx) {
    const Region& region = decomposition_.regions[idx];
    // [Sala06 Def. 3.4] any two stations of a region are joined by a path inside of it
    const size_t num_reached = ReachableFrom(region.stations[0], region.stations).size();
    if (num_reached < region.stations.size()) {
      Fail("region {} is not connected: {} of its {} stations cannot be reached from station {}", idx,
           region.stations.size() - num_reached, region.stations.size(), region.stations[0]);
    }
    // [Sala06 Def. 3.8] |intersection of F_v over v in R| >= k
    if (static_cast<int>(region.features.size()) < decomposition_.k) {
      Fail("region {} has {} features, fewer than k = {}", idx, region.features.size(), decomposition_.k);
    }
    for (const FeatureIdx feature : region.features) {
      const StationSet& area = world_.areas[feature];
      const auto blind = std::find_if(
          region.stations.begin(), region.stations.end(),
          [&](StationIdx station) { return !std::binary_search(area.begin(), area.end(), station); });
      if (blind != region.stations.end()) {
        Fail("region {}: feature {} is not visible from station {}", idx, feature, *blind);
      }
    }
  }

  // [Sala06 Def. 3.7] Which regions contain the neighbourhood of each coverable station.
  void CheckCoverage() {
    visited_.assign(world_.num_stations(), false);
    regions_of_.resize(world_.num_stations());
    std::vector<std::vector<int>> regions_with(world_.num_stations());
    for (size_t i = 0; i < decomposition_.regions.size(); ++i) {
      for (const StationIdx station : decomposition_.regions[i].stations)
        regions_with[station].push_back(static_cast<int>(i));
    }
    for (StationIdx station = 0; station < world_.num_stations(); ++station) {
      const StationSet neighbourhood = Neighbourhood(station);
      std::vector<FeatureIdx> common = sets_[station];
      std::vector<int> containing = regions_with[station];
      for (const StationIdx other : neighbourhood) {
        Intersect(sets_[other], &common);
        Intersect(regions_with[other], &containing);
      }
      if (static_cast<int>(common.size()) < decomposition_.k) continue;  // [Sala06 §V-A] not coverable
      ++check_.num_coverable;
      regions_of_[station] = containing;
      if (containing.empty()) uncovered_.push_back(station);
    }
    check_.num_uncovered = static_cast<int>(uncovered_.size());
    StationSet difference;
    std::set_symmetric_difference(uncovered_.begin(), uncovered_.end(), decomposition_.uncovered.begin(),
                                  decomposition_.uncovered.end(), std::back_inserter(difference));
    if (!difference.empty()) {
      const bool listed =
          std::binary_search(decomposition_.uncovered.begin(), decomposition_.uncovered.end(), difference[0]);
      Fail("station {} is {} as uncovered, but {} ({} such differences)", difference[0],
           listed ? "listed" : "not listed",
           listed ? "it is covered or not coverable" : "no region contains its neighbourhood",
           difference.size());
    }
    // [Sala06 Def. 3.5] The regions' union is V: of coverable stations, and where rho lets none go.
    if (decomposition_.rho == 0 && !uncovered_.empty()) {
      Fail("{} coverable stations are uncovered although rho = 0; first: station {}", uncovered_.size(),
           uncovered_[0]);
    }
  }

  static void Intersect(const std::vector<int32_t>& with, std::vector<int32_t>* list) {
    std::erase_if(*list, [&](int32_t value) { return !std::binary_search(with.begin(), with.end(), value); });
  }

  // [Sala06 §V-D] No region can go without leaving a station uncovered.
  void CheckRedundancy() {
    std::vector<bool> needed(decomposition_.regions.size(), false);
    for (const std::vector<int>& regions : regions_of_) {
      if (regions.size() == 1) needed[regions[0]] = true;
    }
    for (size_t i = 0; i < needed.size(); ++i) {
      if (!needed[i]) Fail("region {} is redundant: every station that it covers is covered by another", i);
    }
  }

  void CheckBound() {
    if (!decomposition_.lower_bound) return;
    if (*decomposition_.lower_bound > static_cast<int>(decomposition_.regions.size())) {
      Fail("the lower bound {} exceeds the {} regions", *decomposition_.lower_bound,
           decomposition_.regions.size());
    }
    if (decomposition_.uncovered_limit < check_.num_uncovered) {
      Fail("the lower bound allows {} uncovered stations, but there are {}", decomposition_.uncovered_limit,
           check_.num_uncovered);
    }
  }

  const World& world_;
  const Decomposition& decomposition_;
  const std::vector<StationSet> neighbours_;
  const std::vector<std::vector<FeatureIdx>> sets_;
  mutable std::vector<bool> visited_;
  std::vector<std::vector<int>>
      regions_of_;  // per coverable station: the regions that contain its neighbourhood
  StationSet uncovered_;
  RegionCheck check_;
};

}  // namespace

RegionCheck CheckRegions(const World& world, const Decomposition& decomposition, int max_hole) {
  return Checker(world, decomposition).Check(max_hole);
}

}  // namespace cairn::decompose_regions
