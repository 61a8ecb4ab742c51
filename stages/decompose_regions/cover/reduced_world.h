#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/ids.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

class IndexLists;
// Neighbours of every station, ascending.
IndexLists NeighbourLists(const World& world);

// Lists of indices, one after the other in one array.
class IndexLists {
 public:
  int size() const { return static_cast<int>(begins_.size()) - 1; }
  int64_t num_values() const { return static_cast<int64_t>(values_.size()); }
  std::span<const int32_t> operator[](int list) const {
    return {values_.data() + begins_[list], values_.data() + begins_[list + 1]};
  }
  void Reserve(int64_t num_values) { values_.reserve(num_values); }
  void Append(std::span<const int32_t> list) {
    values_.insert(values_.end(), list.begin(), list.end());
    begins_.push_back(static_cast<int64_t>(values_.size()));
  }
  // For each value v in [0, num_values): the lists that contain it, ascending.
  IndexLists Transposed(int num_lists) const;
  friend IndexLists NeighbourLists(const World& world);

 private:
  std::vector<int64_t> begins_ = {0};
  std::vector<int32_t> values_;
};

// Keeps those of `stations` that are in `area`; the others are appended to `removed`, if it is given.
// All ascending.
void KeepCommon(std::span<const StationIdx> area, std::vector<StationIdx>* stations,
                std::vector<StationIdx>* removed = nullptr);
// The stations in the areas of all of some features, ascending.  REQUIRES: at least one feature
std::vector<StationIdx> CommonStations(const IndexLists& areas, std::span<const int32_t> features);

// The 0-overlapping problem that a world is reduced to [Sala06 §IV, Theorem 4.1]:
//   F'_v = intersection of F_w over w in N_tau(v),
// which shrinks every feature's area by tau hops; then only coverable stations (|F'_v| >= k) stay [Sala06
// §V-A], and each connected component of an area becomes a feature of its own [Sala06 §V-C].  Features are in
// an order drawn from the seed, so that "the first of several equal ones" is a random choice.
struct ReducedWorld {
  int k = 0;
  IndexLists neighbours;             // G
  IndexLists areas;                  // per reduced feature: its stations, ascending
  IndexLists sets;                   // F'_v: per station its reduced features, ascending
  std::vector<FeatureIdx> original;  // per reduced feature: the world's feature; several may share one
  std::vector<char> coverable;       // per station
  int num_coverable = 0;
  IndexLists whole_areas;  // AreaSplit::kBeforeShrinking: per reduced feature, its area before it shrank
  int max_set_size = 0;    // largest |F'_v|, before uncoverable stations were removed,
  StationIdx max_set_station = -1;  // and the station that has it
  int num_stations() const { return neighbours.size(); }
};
// When areas are split into components.  kAfterShrinking: every reduced area is connected.  kBeforeShrinking:
// areas are split as they are and may fall apart when they shrink: then every connected region R whose
// stations all see k features lies in the whole areas of k reduced features, and the stations it covers,
// { v : N_tau(v) inside of R }, lie in their shrunk areas, also where these stations are not connected though
// R is.
enum class AreaSplit { kAfterShrinking, kBeforeShrinking };
// O(incidences * degree * tau).
ReducedWorld ReduceWorld(const World& world, int k, int tau, uint64_t seed,
                         AreaSplit split = AreaSplit::kAfterShrinking);

// Finds connected parts of station sets; keeps scratch memory of the graph's size between calls.  Joins runs
// of stations with consecutive numbers, of which a lattice that is numbered row by row has few.
class ComponentFinder {
 public:
  explicit ComponentFinder(const IndexLists& neighbours);
  // Components of a set of stations, each ascending, ordered by their first station.  The set is ascending.
  std::vector<std::vector<StationIdx>> Components(std::span<const StationIdx> stations);
  // Their number.
  int NumComponents(std::span<const StationIdx> stations);

 private:
  // Numbers the runs of the set in run_of_, and joins adjacent ones in parents_.  Returns the number
  // of components.
  int JoinRuns(std::span<const StationIdx> stations);
  int32_t Root(int32_t run);

  IndexLists earlier_;                    // neighbours with a smaller number, except the one right before
  std::vector<char> joined_to_previous_;  // an edge joins station s - 1 to s
  std::vector<int32_t> run_of_;           // -1: not in the set
  std::vector<int32_t> parents_;          // of runs: union-find, smaller numbers towards the root
};

// Stations within tau hops of a set, ascending: the inverse of the reduction, R' = union of N_tau(v)
// [Sala06 Theorem 4.2].
std::vector<StationIdx> GrowStations(const IndexLists& neighbours, std::vector<StationIdx> stations, int tau);
// Stations whose N_tau lies in a set, ascending.
std::vector<StationIdx> ShrinkStations(const IndexLists& neighbours, std::vector<StationIdx> stations,
                                       int tau);

}  // namespace cairn::decompose_regions
