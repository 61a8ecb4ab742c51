#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "stages/decompose_regions/cover/cover.h"

namespace cairn::decompose_regions {

// The six algorithms of [Sala06 §V-B, §V-C].  Each fills a Cover of a reduced world until no station is open.

// [Sala06 Fig. 3] A.x: regions grow from seeds.  They differ in the seed, line 3.
void AlgorithmA1(uint64_t seed, Cover* cover);  // the open station with the fewest features (algorithm_a1.cc)
void AlgorithmA2(uint64_t seed, Cover* cover);  // the open station with the most features (algorithm_a2.cc)
void AlgorithmA3(uint64_t seed, Cover* cover);  // a random open station (algorithm_a3.cc)
// [Sala06 Fig. 4] B.x: all open stations shrink to those that see k features.
void AlgorithmB1(Cover* cover);  // regions stay                                (algorithm_b1.cc)
void AlgorithmB2(Cover* cover);  // a region pushes out others                  (algorithm_b2.cc)
// [Sala06 Fig. 5] C: as B, but the features are visible all over a disc; B.1 covers the rest.
void AlgorithmC(double alpha, Cover* cover);  //                                (algorithm_c.cc)

// What they share.

// [Sala06 Fig. 3] A.x with the seeds in this order of preference.
void GrowFromSeeds(const std::vector<StationIdx>& seed_order, uint64_t seed, Cover* cover);
// A number per station, all different, drawn from the seed: ties go to the smaller one.
std::vector<int32_t> RandomRanks(int num_stations, uint64_t seed);

// [Sala06 Fig. 4 lines 3-9] Picks k features one by one, each the one seen by most of the open stations that
// see the features before it; then takes all stations, open or not, that see them.
class FeatureChooser {
 public:
  explicit FeatureChooser(Cover* cover);
  // `allowed`: features to choose from; all if null.  The stations may be unconnected.
  // REQUIRES: num_open() > 0, and k features of `allowed` are seen by some open station.
  CoreRegion Choose(const std::vector<int32_t>* allowed = nullptr);

 private:
  void Count(const std::vector<StationIdx>& stations);
  void Uncount(const std::vector<StationIdx>& stations);
  int32_t MostVisible(const std::vector<int32_t>* allowed, const std::vector<int32_t>& chosen) const;

  Cover& cover_;
  // Per feature: number of stations of the current R that see it; `counted`: the features that may
  // be above 0.
  std::vector<int32_t> counts_;
  std::vector<int32_t> counted_;
};

}  // namespace cairn::decompose_regions
