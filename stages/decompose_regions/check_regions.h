#pragma once

#include <string>
#include <vector>

#include "core/world/decomposition.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

// Verdict on a decomposition, computed from the definitions [Sala06 §III] only, independently of
// the algorithms.
struct RegionCheck {
  // One sentence per property that fails, naming the region, station or feature; empty for a
  // valid decomposition.
  std::vector<std::string> violations;
  int num_coverable = 0;
  int num_uncovered = 0;  // coverable stations whose tau-neighbourhood lies in no region
  int largest_hole = 0;   // of the connected parts of the uncovered stations
};

// Checks that every index exists and every list is ascending; every region is connected [Sala06 Def. 3.4] and
// all of its stations see all of its features, at least k different ones [Sala06 Def. 3.8]; the stations
// listed as uncovered are those whose neighbourhood lies in no region [Sala06 Def. 3.7], none where rho = 0;
// no region is redundant [Sala06 §V-D]: without it some covered station would be uncovered; a lower bound is
// at most the number of regions, for at least as many uncovered stations as there are; and, if max_hole >= 0,
// that no hole is larger.  REQUIRES: CheckWorld(world) is ok.
RegionCheck CheckRegions(const World& world, const Decomposition& decomposition, int max_hole = -1);

}  // namespace cairn::decompose_regions
