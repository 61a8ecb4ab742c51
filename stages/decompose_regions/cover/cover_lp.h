#pragma once

#include <vector>

#include "stages/decompose_regions/cover/region_pool.h"

namespace cairn::decompose_regions {

// The linear program of covering all but H open stations with few regions of a pool:
//   min sum of x_R   such that   s_v + sum of x_R over R containing v >= 1   for every station v
//                                sum of s_v <= H,   x >= 0,   0 <= s <= 1
// and its dual: max (sum of y_v) - H z such that y(R) <= 1 for every region of the pool, 0 <= y_v <= z.
// Solved to about a percent by the primal-dual hybrid gradient method with diagonal steps (Pock and Chambolle
// 2011): its dual values lie in the middle of the optimal ones, so that regions found with them are better
// than those from a vertex; any dual values give a valid bound.  Keeps its iterates between calls; regions
// may join the pool in between.  An iteration costs O(open stations + runs of open stations in regions).
class CoverLp {
 public:
  // `pool` outlives this object.  `open`: per station, whether it is to be covered.
  CoverLp(const RegionPool& pool, std::vector<char> open, int max_uncovered);

  // Starts from the dual values of another program over the same pool.
  void StartFrom(const CoverLp& other);
  void Iterate(int num_iterations);
  // Takes a region into the cover permanently: its stations are no longer open.
  void Fix(int region);
  int num_open() const { return num_open_; }
  int max_uncovered() const { return max_uncovered_; }
  void set_max_uncovered(int max_uncovered) { max_uncovered_ = max_uncovered; }

  // Averages over the last call of Iterate.
  const std::vector<double>& station_values() const { return mean_y_; }  // y_v; 0 where not open
  const std::vector<double>& region_values() const { return mean_x_; }   // x_R; 0 where no station is open

 private:
  // Regions with open stations, as runs of open stations, which are numbered 0, 1, ...; rebuilt when
  // either changes.
  struct OpenRegions {
    struct Entry {
      int region;
      size_t first_run;
      double step;  // of x
    };
    std::vector<StationIdx> stations;  // the open ones
    std::vector<Entry> entries;        // plus one that ends the last region's runs
    std::vector<RegionPool::Run> runs;
    std::vector<double> dual_steps;  // per open station
  };
  // The iterates of the open stations, and scratch of the same length, plus one where sums run.
  struct Iterates {
    std::vector<double> y, s, y_sum, partial_sums, cover_steps;
  };
  void CollectOpen();
  void StepRegions(Iterates* now);
  void StepStations(Iterates* now);

  const RegionPool* pool_;
  std::vector<char> open_;
  int num_open_ = 0;
  int max_uncovered_ = 0;
  OpenRegions collected_;
  bool is_collected_ = false;
  std::vector<double> x_, s_, y_, mean_x_, mean_y_;
  double z_ = 0;
};

}  // namespace cairn::decompose_regions
