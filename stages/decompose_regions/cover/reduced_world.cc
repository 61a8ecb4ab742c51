#include "stages/decompose_regions/cover/reduced_world.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "core/base/random.h"

namespace cairn::decompose_regions {
namespace {

// Shrinks sets of stations hop by hop; keeps scratch memory of the graph's size between calls.
class Shrinker {
 public:
  explicit Shrinker(const IndexLists& neighbours) : neighbours_(neighbours), mark_(neighbours.size(), 0) {
    int degree = 0;
    for (StationIdx station = 0; station < neighbours.size(); ++station) {
      degree = std::max(degree, static_cast<int>(neighbours[station].size()));
    }
    if (degree > kWidth) return;
    rows_.resize(neighbours.size());
    for (StationIdx station = 0; station < neighbours.size(); ++station) {
      rows_[station].fill(station);
      std::copy(neighbours[station].begin(), neighbours[station].end(), rows_[station].begin());
    }
  }

  // [Sala06 Lemma 4.1] {v in R : N_tau(v) inside of R}: keeps the stations of which every station within tau
  // hops is in the set.  The border of the graph does not shrink a set [Sala06 fn 2].
  void Shrink(std::vector<StationIdx>* stations, int tau) {
    for (int hop = 0; hop < tau && !stations->empty(); ++hop) {
      for (const StationIdx station : *stations) mark_[station] = 1;
      kept_.resize(stations->size());
      size_t num_kept = 0;
      for (const StationIdx station : *stations) {
        kept_[num_kept] = station;
        num_kept += rows_.empty() ? HasAllNeighbours(station) : HasWholeRow(station);
      }
      for (const StationIdx station : *stations) mark_[station] = 0;
      if (num_kept == stations->size()) return;  // whole components of the graph: more hops change nothing
      kept_.resize(num_kept);
      stations->swap(kept_);
    }
  }

 private:
  static constexpr int kWidth = 4;  // of a lattice

  bool HasAllNeighbours(StationIdx station) const {
    const auto neighbours = neighbours_[station];
    return std::all_of(neighbours.begin(), neighbours.end(), [&](StationIdx n) { return mark_[n] != 0; });
  }
  bool HasWholeRow(StationIdx station) const {
    const std::array<StationIdx, kWidth>& row = rows_[station];
    return (mark_[row[0]] & mark_[row[1]] & mark_[row[2]] & mark_[row[3]]) != 0;
  }

  const IndexLists& neighbours_;
  // Where no station has more than kWidth neighbours: its neighbours, and the station itself in the
  // remaining places.
  std::vector<std::array<StationIdx, kWidth>> rows_;
  std::vector<char> mark_;
  std::vector<StationIdx> kept_;
};

std::vector<FeatureIdx> ShuffledFeatures(int num_features, uint64_t seed) {
  std::vector<FeatureIdx> order(num_features);
  std::iota(order.begin(), order.end(), 0);
  Random random(seed);
  for (int i = num_features - 1; i > 0; --i) std::swap(order[i], order[random.UniformInt(0, i)]);
  return order;
}

}  // namespace

IndexLists IndexLists::Transposed(int num_lists) const {
  IndexLists transposed;
  transposed.begins_.assign(num_lists + 1, 0);
  for (const int32_t value : values_) ++transposed.begins_[value + 1];
  std::partial_sum(transposed.begins_.begin(), transposed.begins_.end(), transposed.begins_.begin());
  transposed.values_.resize(values_.size());
  std::vector<int64_t> next(transposed.begins_.begin(), transposed.begins_.end() - 1);
  for (int list = 0; list < size(); ++list) {
    for (const int32_t value : (*this)[list]) transposed.values_[next[value]++] = list;
  }
  return transposed;
}

void KeepCommon(std::span<const StationIdx> area, std::vector<StationIdx>* stations,
                std::vector<StationIdx>* removed) {
  auto seen = area.begin();
  std::erase_if(*stations, [&](StationIdx station) {
    while (seen != area.end() && *seen < station) ++seen;
    if (seen != area.end() && *seen == station) return false;
    if (removed) removed->push_back(station);
    return true;
  });
}

std::vector<StationIdx> CommonStations(const IndexLists& areas, std::span<const int32_t> features) {
  std::vector<StationIdx> stations(areas[features[0]].begin(), areas[features[0]].end());
  for (const int32_t feature : features.subspan(1)) KeepCommon(areas[feature], &stations);
  return stations;
}

IndexLists NeighbourLists(const World& world) {
  // Edges are ascending: those to smaller stations come first, and every list is ascending.
  IndexLists lists;
  lists.begins_.assign(world.num_stations() + 1, 0);
  for (const auto& [u, v] : world.edges) ++lists.begins_[u + 1], ++lists.begins_[v + 1];
  std::partial_sum(lists.begins_.begin(), lists.begins_.end(), lists.begins_.begin());
  lists.values_.resize(2 * world.edges.size());
  std::vector<int64_t> next(lists.begins_.begin(), lists.begins_.end() - 1);
  for (const auto& [u, v] : world.edges) {
    lists.values_[next[u]++] = v;
    lists.values_[next[v]++] = u;
  }
  return lists;
}

ComponentFinder::ComponentFinder(const IndexLists& neighbours)
    : joined_to_previous_(neighbours.size(), 0), run_of_(neighbours.size(), -1) {
  std::vector<StationIdx> earlier;
  for (StationIdx station = 0; station < neighbours.size(); ++station) {
    earlier.clear();
    for (const StationIdx other : neighbours[station]) {
      if (other == station - 1) joined_to_previous_[station] = 1;
      if (other < station - 1) earlier.push_back(other);
    }
    earlier_.Append(earlier);
  }
}

int32_t ComponentFinder::Root(int32_t run) {
  while (parents_[run] != run) run = parents_[run] = parents_[parents_[run]];
  return run;
}

int ComponentFinder::JoinRuns(std::span<const StationIdx> stations) {
  parents_.clear();
  int num_components = 0;
  StationIdx previous = -2;
  for (const StationIdx station : stations) {
    if (previous != station - 1 || !joined_to_previous_[station]) {
      parents_.push_back(static_cast<int32_t>(parents_.size()));
      ++num_components;
    }
    previous = station;
    const auto run = static_cast<int32_t>(parents_.size()) - 1;
    run_of_[station] = run;
    for (const StationIdx other : earlier_[station]) {
      if (run_of_[other] < 0 || parents_[run] == parents_[run_of_[other]]) continue;
      const int32_t a = Root(run_of_[other]), b = Root(run);
      if (a == b) continue;
      parents_[std::max(a, b)] = std::min(a, b);
      --num_components;
    }
  }
  return num_components;
}

int ComponentFinder::NumComponents(std::span<const StationIdx> stations) {
  const int num_components = JoinRuns(stations);
  for (const StationIdx station : stations) run_of_[station] = -1;
  return num_components;
}

// [Sala06 Def. 3.4] A region is connected: each connected part of a set of stations is one by itself.
std::vector<std::vector<StationIdx>> ComponentFinder::Components(std::span<const StationIdx> stations) {
  std::vector<std::vector<StationIdx>> components;
  if (const int num_components = JoinRuns(stations); num_components == 1) {  // the usual case
    components.emplace_back(stations.begin(), stations.end());
  } else {
    components.reserve(num_components);
    std::vector<int32_t> component_of(parents_.size(), -1);  // per run that is a root
    for (const StationIdx station : stations) {
      int32_t& component = component_of[Root(run_of_[station])];
      if (component < 0) {
        component = static_cast<int32_t>(components.size());
        components.emplace_back();
      }
      components[component].push_back(station);
    }
  }
  for (const StationIdx station : stations) run_of_[station] = -1;
  return components;
}

// [Sala06 Def. 3.6, Lemma 4.2] Union of N_tau(v) over v in R, ring by ring.
std::vector<StationIdx> GrowStations(const IndexLists& neighbours, std::vector<StationIdx> stations,
                                     int tau) {
  size_t begin = 0;
  std::vector<StationIdx> grown = stations;
  for (int hop = 0; hop < tau && begin < stations.size(); ++hop) {
    std::vector<StationIdx> next;
    for (size_t i = begin; i < stations.size(); ++i) {
      next.insert(next.end(), neighbours[stations[i]].begin(), neighbours[stations[i]].end());
    }
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
    std::vector<StationIdx> fresh;
    std::set_difference(next.begin(), next.end(), grown.begin(), grown.end(), std::back_inserter(fresh));
    const auto middle = grown.insert(grown.end(), fresh.begin(), fresh.end());
    std::inplace_merge(grown.begin(), middle, grown.end());
    begin = stations.size();
    stations.insert(stations.end(), fresh.begin(), fresh.end());
  }
  return grown;
}

std::vector<StationIdx> ShrinkStations(const IndexLists& neighbours, std::vector<StationIdx> stations,
                                       int tau) {
  Shrinker(neighbours).Shrink(&stations, tau);
  return stations;
}

ReducedWorld ReduceWorld(const World& world, int k, int tau, uint64_t seed, AreaSplit split) {
  ReducedWorld reduced;
  reduced.k = k;
  reduced.neighbours = NeighbourLists(world);
  const int num_stations = world.num_stations();

  // [Sala06 Theorem 4.1] F'_v = intersection of F_w over w in N_tau(v): v stays in a feature's area if all of
  // N_tau(v) is in it. (Shrinking the components of an area one by one gives the same stations as shrinking
  // the area.)
  Shrinker shrinker(reduced.neighbours);
  ComponentFinder finder(reduced.neighbours);
  IndexLists shrunk;
  std::vector<FeatureIdx> original;
  std::vector<int> set_sizes(num_stations, 0);
  if (tau == 0) shrunk.Reserve(world.num_incidences());
  std::vector<StationIdx> area;
  IndexLists whole;
  const auto shrink = [&](FeatureIdx feature) {
    shrinker.Shrink(&area, tau);
    for (const StationIdx station : area) ++set_sizes[station];
    shrunk.Append(area);
    original.push_back(feature);
  };
  for (const FeatureIdx feature : ShuffledFeatures(world.num_features(), seed)) {
    if (split == AreaSplit::kAfterShrinking) {
      area = world.areas[feature];
      shrink(feature);
      continue;
    }
    for (std::vector<StationIdx>& component : finder.Components(world.areas[feature])) {
      whole.Append(component);
      area.swap(component);
      shrink(feature);
    }
  }

  // [Sala06 §V-A] Only stations that see k features are to be covered; no region can contain another.
  reduced.coverable.resize(num_stations);
  for (StationIdx station = 0; station < num_stations; ++station) {
    reduced.coverable[station] = set_sizes[station] >= k;
    reduced.num_coverable += reduced.coverable[station];
    if (set_sizes[station] > reduced.max_set_size || reduced.max_set_station < 0) {
      reduced.max_set_size = set_sizes[station];
      reduced.max_set_station = station;
    }
  }

  // [Sala06 §V-C] Each component of an area becomes the area of a feature of its own.
  reduced.areas.Reserve(shrunk.num_values());
  for (int i = 0; i < shrunk.size(); ++i) {
    area.clear();
    for (const StationIdx station : shrunk[i]) {
      if (reduced.coverable[station]) area.push_back(station);
    }
    if (split == AreaSplit::kBeforeShrinking) {
      if (area.empty()) continue;
      reduced.areas.Append(area);
      reduced.whole_areas.Append(whole[i]);
      reduced.original.push_back(original[i]);
      continue;
    }
    if (finder.NumComponents(area) == 1) {  // the usual case
      reduced.areas.Append(area);
      reduced.original.push_back(original[i]);
      continue;
    }
    for (const std::vector<StationIdx>& component : finder.Components(area)) {
      reduced.areas.Append(component);
      reduced.original.push_back(original[i]);
    }
  }
  reduced.sets = reduced.areas.Transposed(num_stations);
  return reduced;
}

}  // namespace cairn::decompose_regions
