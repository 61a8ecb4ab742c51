#pragma once

#include <cstdint>

#include "core/plan/views.h"

namespace cairn::decompose_views {

struct MergeLoss {
  int64_t num_regions = 0;  // joined to others
  double area_m2 = 0;       // of these
  int64_t num_labels = 0;   // labels in which they differed from the regions that they were joined to, in all
};

// Joins regions smaller than an area to neighbours, the smallest first: to the one whose label set differs
// least, of these to the one with the longest common border.  The label set is that of the larger one, so it
// no longer holds in all of the region, and regions are no longer convex; both are why this is an option.  A
// join that would leave a hole or a pinched corner is not made.  Index values are those of the larger
// region.  Deterministic.
MergeLoss MergeSmallRegions(double min_area_m2, Views* views);

}  // namespace cairn::decompose_views
