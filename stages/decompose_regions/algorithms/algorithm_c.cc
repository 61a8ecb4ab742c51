// [Sala06 Fig. 5] Algorithm C: shrink around a disc.
#include <algorithm>
#include <numeric>

#include "stages/decompose_regions/algorithms/algorithms.h"

namespace cairn::decompose_regions {
namespace {

// Discs N_t(v), ring by ring, and the features that are visible from all their open stations.
class Disc {
 public:
  explicit Disc(const Cover& cover)
      : cover_(cover), seen_(cover.world().num_stations(), 0), counts_(cover.world().areas.size(), 0) {}

  // N_0(center).
  void Start(StationIdx center) {
    for (const StationIdx station : stations_) seen_[station] = 0;
    for (const int32_t feature : counted_) counts_[feature] = 0;
    stations_.clear(), counted_.clear();
    num_open_ = 0;
    ring_ = 0;
    Include(center);
  }
  // N_t to N_{t+1}; false if that is the same set.
  bool Widen() {
    const size_t end = stations_.size();
    for (size_t i = ring_; i < end; ++i) {
      for (const StationIdx next : cover_.world().neighbours[stations_[i]]) {
        if (!seen_[next]) Include(next);
      }
    }
    ring_ = end;
    return stations_.size() > end;
  }

  int num_stations() const { return static_cast<int>(stations_.size()); }
  int num_open() const { return num_open_; }
  // Phi: the features that all open stations of the disc see, ascending.
  std::vector<int32_t> CommonFeatures() const {
    std::vector<int32_t> common;
    for (const int32_t feature : counted_) {
      if (counts_[feature] == num_open_) common.push_back(feature);
    }
    std::sort(common.begin(), common.end());
    return common;
  }
  int NumCommonFeatures() const {
    return static_cast<int>(
        std::count_if(counted_.begin(), counted_.end(), [&](int32_t f) { return counts_[f] == num_open_; }));
  }

 private:
  void Include(StationIdx station) {
    seen_[station] = 1;
    stations_.push_back(station);
    if (!cover_.IsOpen(station)) return;
    ++num_open_;
    for (const int32_t feature : cover_.world().sets[station]) {
      if (counts_[feature]++ == 0) counted_.push_back(feature);
    }
  }

  const Cover& cover_;
  std::vector<char> seen_;
  std::vector<int32_t> counts_;  // open stations of the disc that see a feature
  std::vector<int32_t> counted_;
  std::vector<StationIdx> stations_;
  size_t ring_ = 0;  // where the outermost ring begins
  int num_open_ = 0;
};

// [Sala06 Fig. 5 line 2]
//   r = max {t : |{u in U : |intersection of F_w over w in N_t(u) ∩ U| >= k}| >= |U| / 2}
// The intersection only shrinks with t, so each u has a largest t of its own, and r is their (upper) median.
// Differs: a disc that has become its whole component grows no more and counts with that radius; there the
// source's t would have no maximum.
int DiscRadius(const Cover& cover) {
  const ReducedWorld& world = cover.world();
  Disc disc(cover);
  std::vector<int> radii;
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (!cover.IsOpen(station)) continue;
    disc.Start(station);
    int radius = 0;
    while (disc.Widen() && disc.NumCommonFeatures() >= world.k) ++radius;
    radii.push_back(radius);
  }
  const auto middle = radii.begin() + (radii.size() + 1) / 2 - 1;
  std::nth_element(radii.begin(), middle, radii.end(), std::greater<>());
  return *middle;
}

}  // namespace

void AlgorithmC(double alpha, Cover* cover) {
  const ReducedWorld& world = cover->world();
  FeatureChooser chooser(cover);
  const int radius = DiscRadius(*cover);  // [Sala06 Fig. 5 line 2]
  Disc disc(*cover);
  // [Sala06 Fig. 5 line 3] In the order of the stations, for discs side by side: random order leaves gaps.
  for (StationIdx station = 0; station < world.num_stations(); ++station) {
    if (!cover->HasOpen()) return;
    disc.Start(station);  // [Sala06 Fig. 5 line 4] C = N_r(v) ∩ U
    for (int t = 0; t < radius && disc.Widen(); ++t) {
    }
    // [Sala06 Fig. 5 line 6] |C| >= alpha |N_r(v)| and |Phi| >= k
    if (disc.num_open() == 0 || disc.num_open() < alpha * disc.num_stations()) continue;
    const std::vector<int32_t> common = disc.CommonFeatures();  // [Sala06 Fig. 5 line 5] Phi
    if (static_cast<int>(common.size()) < world.k) continue;
    const CoreRegion region = chooser.Choose(&common);       // [Sala06 Fig. 5 lines 7-13]
    cover->AddComponents(region.features, region.stations);  // [Sala06 Fig. 5 lines 14-15], by rho
  }
  AlgorithmB1(cover);  // [Sala06 §V-C] what is left of U
}

}  // namespace cairn::decompose_regions
