#pragma once

#include <vector>

#include "stages/decompose_regions/region_pool.h"

namespace cairn {

// The linear program of covering all but H open stations with few regions of a pool:
//   min sum of x_R   such that   s_v + sum of x_R over R containing v >= 1,   sum of s_v <= H,   x >= 0,  0
//   <= s <= 1
// and its dual: max (sum of y_v) - H z such that y(R) <= 1 for every region of the pool, 0 <= y_v <= z.
// Solved to about a percent by the primal-dual hybrid gradient method with diagonal steps (Pock and Chambolle
// 2011): its dual values lie in the middle of the optimal ones, so that regions found with them serve better
// than those of a vertex, and any dual values give a valid bound.  Keeps its iterates between calls; regions
// may join the pool in between.
class CoverLp {
 public:
  // `pool` outlives this object.  `open`: per station, whether it is to be covered.
  CoverLp(const RegionPool& pool, std::vector<char> open, int max_uncovered);

  // Starts from the dual values of another program over the same pool.
  void StartFrom(const CoverLp& other);
  void Iterate(int num_iterations);
  // Takes a region into the cover for good: its stations are open no more.
  void Fix(int region);
  int num_open() const { return num_open_; }
  int max_uncovered() const { return max_uncovered_; }

  // Averages over the last call of Iterate.
  const std::vector<double>& station_values() const { return mean_y_; }  // y_v; 0 where not open
  const std::vector<double>& region_values() const { return mean_x_; }   // x_R; 0 where no station is open

 private:
  // Regions with open stations and these stations, side by side; remade when either changed.
  struct OpenRegions {
    std::vector<int> regions;
    std::vector<size_t> begins;
    std::vector<StationIdx> stations;
    std::vector<StationIdx> open_stations;
    std::vector<double> dual_steps;  // per open station
  };
  void CollectOpen();
  void StepRegions(double weight);
  void StepStations(double weight);

  const RegionPool* pool_;
  std::vector<char> open_;
  int num_open_ = 0;
  int max_uncovered_ = 0;
  OpenRegions collected_;
  bool is_collected_ = false;
  std::vector<double> x_, s_, y_, mean_x_, mean_y_, covered_;
  double z_ = 0;
};

}  // namespace cairn
