#include "stages/decompose_regions/reduced_world.h"

#include <algorithm>
#include <numeric>

#include "core/random.h"

namespace cairn {
namespace {

// Shrinks sets of stations hop by hop; keeps scratch memory of the graph's size between calls.
class Shrinker {
 public:
  explicit Shrinker(const IndexLists& neighbours) : neighbours_(neighbours), mark_(neighbours.size(), 0) {}

  // Keeps the stations of which every station within tau hops is in the set.  The border of the graph does
  // not shrink a set [Sala06 fn 2].
  void Shrink(std::vector<StationIdx>* stations, int tau) {
    for (int hop = 0; hop < tau && !stations->empty(); ++hop) {
      for (const StationIdx station : *stations) mark_[station] = 1;
      kept_.clear();
      for (const StationIdx station : *stations) {
        const auto neighbours = neighbours_[station];
        if (std::all_of(neighbours.begin(), neighbours.end(), [&](StationIdx n) { return mark_[n] != 0; })) {
          kept_.push_back(station);
        }
      }
      for (const StationIdx station : *stations) mark_[station] = 0;
      if (kept_.size() == stations->size())
        return;  // whole components of the graph: more hops change nothing
      stations->swap(kept_);
    }
  }

 private:
  const IndexLists& neighbours_;
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

IndexLists NeighbourLists(const World& world) {
  IndexLists lists;
  const std::vector<std::vector<StationIdx>> adjacency = AdjacencyLists(world);
  lists.Reserve(2 * static_cast<int64_t>(world.edges.size()));
  for (const std::vector<StationIdx>& neighbours : adjacency) lists.Append(neighbours);
  return lists;
}

std::vector<std::vector<StationIdx>> ComponentFinder::Components(std::span<const StationIdx> stations) {
  std::vector<std::vector<StationIdx>> components;
  for (const StationIdx station : stations) mark_[station] = 1;
  for (const StationIdx start : stations) {
    if (!mark_[start]) continue;
    mark_[start] = 0;
    std::vector<StationIdx>& component = components.emplace_back(1, start);
    component.reserve(stations.size());
    for (size_t i = 0; i < component.size(); ++i) {
      for (const StationIdx next : neighbours_[component[i]]) {
        if (!mark_[next]) continue;
        mark_[next] = 0;
        component.push_back(next);
      }
    }
    if (component.size() == stations.size()) {  // connected: the usual case
      component.assign(stations.begin(), stations.end());
    } else {
      std::sort(component.begin(), component.end());
    }
  }
  return components;
}

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

ReducedWorld ReduceWorld(const World& world, int k, int tau, uint64_t seed) {
  ReducedWorld reduced;
  reduced.k = k;
  reduced.neighbours = NeighbourLists(world);
  const int num_stations = world.num_stations();

  // [Sala06 §IV] F'_v = intersection of F_w over w in N_tau(v): v stays in a feature's area if all of
  // N_tau(v) is in it.
  Shrinker shrinker(reduced.neighbours);
  IndexLists shrunk;
  std::vector<int> set_sizes(num_stations, 0);
  const std::vector<FeatureIdx> order = ShuffledFeatures(world.num_features(), seed);
  int64_t num_incidences = 0;
  for (const std::vector<StationIdx>& area : world.areas) num_incidences += static_cast<int64_t>(area.size());
  if (tau == 0) shrunk.Reserve(num_incidences);
  std::vector<StationIdx> area;
  for (const FeatureIdx feature : order) {
    area = world.areas[feature];
    shrinker.Shrink(&area, tau);
    for (const StationIdx station : area) ++set_sizes[station];
    shrunk.Append(area);
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
  ComponentFinder finder(reduced.neighbours);
  reduced.areas.Reserve(shrunk.num_values());
  for (size_t i = 0; i < order.size(); ++i) {
    area.clear();
    for (const StationIdx station : shrunk[static_cast<int>(i)]) {
      if (reduced.coverable[station]) area.push_back(station);
    }
    for (const std::vector<StationIdx>& component : finder.Components(area)) {
      reduced.areas.Append(component);
      reduced.original.push_back(order[i]);
    }
  }
  reduced.sets = reduced.areas.Transposed(num_stations);
  return reduced;
}

}  // namespace cairn
