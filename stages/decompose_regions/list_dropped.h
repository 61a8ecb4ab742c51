#pragma once

#include <vector>

#include "core/world/decomposition.h"
#include "core/world/dropped_items.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

// The features of a world that no region of a decomposition keeps, and the stations whose tau-neighbourhood
// lies in none, each with the reason:
//   not_common           in no region do all stations see it
//   not_chosen           in some region all stations see it
//   few_features         fewer than k features are visible from the station
//   few_common_features  at least k are, but fewer from the station and all others within tau hops
//   left_over            the station is coverable: decomposition.uncovered
// First features, then stations, ascending.  Derived from the decomposition alone, independently of the
// algorithm.  O(incidences * regions of a station + edges * tau).  REQUIRES: CheckWorld(world) is ok, and
// `decomposition` is valid for it (CheckRegions).
std::vector<DroppedItem> ListDropped(const World& world, const Decomposition& decomposition);

}  // namespace cairn::decompose_regions
