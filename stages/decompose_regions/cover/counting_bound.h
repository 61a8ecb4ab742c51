#pragma once

#include "stages/decompose_regions/cover/reduced_world.h"

namespace cairn::decompose_regions {

// A lower bound of the number of regions, found by counting: cheap at any size, weaker than
// column_generation.h.  Let c_v be the k-th largest number of coverable stations that see one of station v's
// features all around, over the features in F'_v.  A region R that covers v has k common features, all in
// F'_v, and the stations that R covers all see each of them: R covers at most c_v stations.  So with y_v = 1
// / c_v the stations that a region covers are worth at most 1 together, and a decomposition that leaves at
// most `max_uncovered` coverable stations uncovered has at least
//   (sum of y_v) - (sum of the `max_uncovered` largest y_v)
// regions, rounded up.  All sums are of whole numbers.  O(incidences + stations log stations).
// `reduced`: with either AreaSplit.
int CountingBound(const ReducedWorld& reduced, int max_uncovered);

}  // namespace cairn::decompose_regions
