// [Sala06 Fig. 3] Algorithm A.x: grow regions from seeds.
#include <algorithm>
#include <numeric>

#include "core/base/random.h"
#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {
namespace {

// One region while it grows.  Invariant: common[w] = |F_w ∩ Phi| for the stations of the frontier, Phi =
// intersection of F_x over the region's stations.
class GrowingRegion {
 public:
  GrowingRegion(const Cover& cover, const std::vector<int32_t>& ranks)
      : cover_(cover),
        world_(cover.world()),
        ranks_(ranks),
        in_phi_(world_.areas.size(), 0),
        visible_(world_.areas.size(), 0),
        role_(world_.num_stations(), kNone),
        common_(world_.num_stations(), 0) {}

  CoreRegion Grow(StationIdx start) {
    // [Sala06 Fig. 3 line 4] R = {v}
    phi_.assign(world_.sets[start].begin(), world_.sets[start].end());
    for (const int32_t feature : phi_) in_phi_[feature] = 1;
    Include(start);
    // [Sala06 Fig. 3 line 5, Fig. 3 line 14] repeat ... until W is empty
    for (StationIdx next = BestOfFrontier(); next >= 0; next = BestOfFrontier()) {
      NarrowPhi(next);
      Include(next);
    }
    CoreRegion region{KeptFeatures(), stations_};
    std::sort(region.stations.begin(), region.stations.end());
    Clear();
    return region;
  }

 private:
  enum Role : char { kNone, kFrontier, kInside };

  // [Sala06 Fig. 3 line 12] R = R u {u}; its neighbours join the frontier, N_1(R) \ R.
  void Include(StationIdx station) {
    role_[station] = kInside;
    stations_.push_back(station);
    for (const StationIdx neighbour : world_.neighbours[station]) {
      if (role_[neighbour] != kNone || !world_.coverable[neighbour]) continue;
      role_[neighbour] = kFrontier;
      frontier_.push_back(neighbour);
      touched_.push_back(neighbour);
      common_[neighbour] = 0;
      for (const int32_t feature : world_.sets[neighbour]) common_[neighbour] += in_phi_[feature];
    }
  }

  // Removes from Phi what `station` does not see.
  void NarrowPhi(StationIdx station) {
    for (const int32_t feature : world_.sets[station]) visible_[feature] = 1;
    std::erase_if(phi_, [&](int32_t feature) {
      if (visible_[feature]) return false;
      in_phi_[feature] = 0;
      for (const StationIdx other : world_.areas[feature]) common_[other] -= role_[other] == kFrontier;
      return true;
    });
    for (const int32_t feature : world_.sets[station]) visible_[feature] = 0;
  }

  // Of W the station that shares most features with the region, open ones first; -1 if W is empty.
  StationIdx BestOfFrontier() {
    // [Sala06 Fig. 3 lines 6-7] W = {u in N_1(R) \ R : |F_u ∩ Phi| >= k}; Phi only shrinks, and so does W
    std::erase_if(frontier_, [&](StationIdx w) { return role_[w] != kFrontier || common_[w] < world_.k; });
    // [Sala06 Fig. 3 line 11] u = argmax |F_w ∩ Phi| over w in W
    StationIdx best = -1;
    for (const StationIdx w : frontier_) {
      if (best < 0 || Key(w) > Key(best)) best = w;
    }
    return best;
  }
  // [Sala06 Fig. 3 lines 8-9] W = W ∩ U if that is not empty: open stations come first.  Ties at random.
  std::tuple<bool, int, int> Key(StationIdx w) const { return {cover_.IsOpen(w), common_[w], -ranks_[w]}; }

  // The k features of Phi that are visible from most stations: neighbouring regions then share some of them.
  std::vector<int32_t> KeptFeatures() const {
    std::vector<int32_t> features = phi_;
    std::stable_sort(features.begin(), features.end(),
                     [&](int32_t a, int32_t b) { return world_.areas[a].size() > world_.areas[b].size(); });
    features.resize(world_.k);
    return features;
  }

  void Clear() {
    for (const int32_t feature : phi_) in_phi_[feature] = 0;
    for (const StationIdx station : touched_) role_[station] = kNone;
    for (const StationIdx station : stations_) role_[station] = kNone;
    frontier_.clear(), touched_.clear(), stations_.clear();
  }

  const Cover& cover_;
  const ReducedWorld& world_;
  const std::vector<int32_t>& ranks_;
  std::vector<int32_t> phi_;
  std::vector<char> in_phi_, visible_;
  std::vector<Role> role_;
  std::vector<int32_t> common_;
  std::vector<StationIdx> stations_, frontier_, touched_;
};

}  // namespace

std::vector<int32_t> RandomRanks(int num_stations, uint64_t seed) {
  std::vector<int32_t> ranks(num_stations);
  std::iota(ranks.begin(), ranks.end(), 0);
  Random random(MixSeed(seed, 1));
  for (int i = num_stations - 1; i > 0; --i) std::swap(ranks[i], ranks[random.UniformInt(0, i)]);
  return ranks;
}

void GrowFromSeeds(const std::vector<StationIdx>& seed_order, uint64_t seed, Cover* cover) {
  const std::vector<int32_t> ranks = RandomRanks(cover->world().num_stations(), seed);
  GrowingRegion growing(*cover, ranks);
  // [Sala06 Fig. 3 lines 2-3] while U is not empty: its first station in the order of the algorithm
  for (const StationIdx station : seed_order) {
    if (!cover->HasOpen()) return;
    if (!cover->IsOpen(station)) continue;
    const CoreRegion region = growing.Grow(station);
    // [Sala06 Fig. 3 lines 15-16] U = U \ R; D = D u {R}, subject to rho
    cover->Add(region);
  }
}

}  // namespace cairn::decompose_regions
