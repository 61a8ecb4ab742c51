#pragma once

#include <string>

#include "core/world/decomposition.h"
#include "core/world/world.h"

namespace cairn::decompose_regions {

// A top view of a decomposition as SVG: every station in the colour of a region that contains it (the one
// with the nearest centre), every region's outline with its number, coverable stations that no region covers
// as hollow squares, stations that are not coverable as dots, a scale bar, and a legend that begins with "R
// regions, at least L are needed" and gives each region's number of landmarks (their places are in the map's
// picture: inspect --svg).  Stations with a heading are sectors.  Colours can be told apart by colour-blind
// readers; regions that overlap or touch get different ones as long as there are enough.  Lengths in the
// picture are in metres of the floor frame, y up.
std::string DrawDecomposition(const World& world, const Decomposition& decomposition);

}  // namespace cairn::decompose_regions
