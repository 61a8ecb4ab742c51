#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "stages/filter_visibility/stations.h"

namespace cairn::filter_visibility {

// Sizes of the holes of an area on the lattice: sets of stations outside of it that are enclosed by it, over
// the 8 neighbours of cells.  Cells without a station (a pillar) are not holes.
std::vector<int> HoleSizes(const std::vector<StationIdx>& area, const Stations& stations);

// Whether the area holds a full block of `side` x `side` stations.
bool HasBlock(const std::vector<StationIdx>& area, const Stations& stations, int side);

// The stations that have at least `min_num_neighbours` of their 8 neighbours in the area, and the neighbours
// of these in the area [Sala06 §VI-B].  One pass is a fixed point: a station with enough neighbours keeps all
// of them.
std::vector<StationIdx> TrimArea(const std::vector<StationIdx>& area, const Stations& stations,
                                 int min_num_neighbours);

}  // namespace cairn::filter_visibility
