#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "core/base/random.h"
#include "stages/decompose_regions/cover/cover_lp.h"
#include "stages/decompose_regions/cover/exact_pricing.h"
#include "stages/decompose_regions/cover/pricing.h"
#include "stages/decompose_regions/cover/region_pool.h"

namespace cairn::decompose_regions {

// Effort of column generation; counts, not times, so that the result does not depend on the machine.
struct ColumnGenerationOptions {
  int num_rounds = 30;               // of greedy pricing, at most
  int num_exact_rounds = 24;         // of exact pricing, at most
  int num_lp_iterations = 150;       // between two greedy pricings
  int num_exact_iterations = 1000;   // of the linear program, between two exact pricings
  int min_new_regions = 20;          // a round adds at most this many regions, or the following share of the
  double max_new_ratio = 0.125;      // coverable stations if that is more
  const Progress* cancel = nullptr;  // no more rounds are made when it is cancelled; null: never
  // Steps of exact pricing for each incidence of the world: of one pricing before it settles for a weaker
  // bound, and of all pricings for one number of uncovered stations.
  int64_t max_work_ratio = 2000, max_total_work_ratio = 10000;
};

// Whole numbers y_v >= 0 of the stations of a world, or of a part of one between which and the rest no region
// passes, that prove how many regions are needed (ColumnGeneration).
struct Certificate {
  int64_t total = 0;            // sum of y_v
  int64_t most_of_station = 0;  // z: at least the largest y_v
  int64_t most_of_region = 0;   // M: at least what any region's core is worth; 0: nothing is proven
};

// The least number of regions of all parts together that leave at most H coverable stations uncovered,
// anywhere.  Of a part that leaves h, there are
//   |D| >= max(0, (total - h z) / M)
// so the least of all is that where what may be left is left in the parts whose stations are worth most of a
// region, as far as there is something to lose.  Rounded up; where H is 0, each part's share is rounded up.
int LeastNumberOfRegions(const std::vector<Certificate>& parts, int max_uncovered);

// The linear relaxation of covering all but H coverable stations with the fewest regions, over all regions of
// the world: repeatedly solves it over a pool of regions and adds regions of value above 1 [Gilmore and
// Gomory 1961].
//
// The bound.  Let y_v >= 0 be whole numbers, z their largest, core(R) = { v : N_tau(v) inside of R }, M >=
// y(core(R)) for every region R with k common features.  A decomposition D that leaves at most H coverable
// stations uncovered has
//   |D| M  >=  sum over R in D of y(core(R))          each region is worth at most M
//          >=  sum of y_v over covered v              each covered station is in the core of some region
//          >=  (sum of y_v) - H z                     at most H stations of at most z are not covered
// so |D| >= ((sum of y_v) - H z) / M, rounded up.  The values y come from the linear program, scaled and
// rounded; none of this depends on how well it was solved.  M comes from branch and bound over all regions
// (ExactPricer::MaxValue).
class ColumnGeneration {
 public:
  // `wide` outlives this object; reduced with AreaSplit::kBeforeShrinking.
  ColumnGeneration(const ReducedWorld& wide, int max_uncovered, const ColumnGenerationOptions& options);
  ColumnGeneration(const ColumnGeneration&) = delete;

  RegionPool& pool() { return pool_; }
  const CoverLp& lp() const { return lp_; }

  // Solves the relaxation.  REQUIRES: the pool's regions cover all but H coverable stations
  void Run();
  // Solves it for a smaller H, with exact pricing: the bound can only grow.  REQUIRES: Run
  void LowerMaxUncovered(int max_uncovered);
  // Certified least number of regions; 0 before Run.
  int lower_bound() const { return lower_bound_; }
  // That of the greatest bound before it is rounded up.
  const Certificate& certificate() const { return certificate_; }
  // Adds regions to the pool that are worthwhile by the values of another program over it; returns how many.
  int Price(const CoverLp& lp);
  // Adds regions to the pool that the relaxation barely leaves out.
  void AddNearlyAsValuable(Random* random);

 private:
  bool IsCancelled() const { return options_.cancel != nullptr && options_.cancel->Cancelled(); }
  void RunExactRounds();
  int AddMostValuable(const StationValues& values, std::vector<CoreRegion> found);

  const ReducedWorld& wide_;
  int max_uncovered_;
  const ColumnGenerationOptions options_;
  const int max_new_regions_;
  RegionPool pool_;
  RegionPricer pricer_;
  ExactPricer exact_pricer_;
  CoverLp lp_;
  int lower_bound_ = 0;
  Certificate certificate_;
};

}  // namespace cairn::decompose_regions
