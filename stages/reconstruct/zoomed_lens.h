#pragma once

#include <string>

#include "stages/reconstruct/view_graph/mapper_input.h"

namespace cairn::reconstruct {

// Says whether the images of a camera differ by a zoom and not by its place.  A pair is zoomed where a
// similarity of the picture, x2 = a x1 + b in complex numbers from the middle of the picture, explains its
// matches: with g = |ln |a|| median |x1|, how far the scale moves a point,
//   g > 1 % of the longer side,  median |a x1 + b - x2| < g / 10,  |b / (1 - a)| < a quarter of that side.
// A camera that goes forward moves near points farther than distant ones, which leaves more than a tenth; one
// that goes straight at a flat wall does not, and its map is as little determined.  Pairs of two cameras do
// not count (a focal length for each is known), nor do those on which less than 1 % moves.  Nothing where
// fewer than four in five of the other pairs are zoomed, or fewer than three.  O(matches).
std::string ZoomedLens(const MapperInput& input);

// Says which images of one camera, in the order of names, show another focal length than others of it.  Of
// every 16 that follow each other the fundamental matrices have a cost by focal length (FocalCost); the lens
// zoomed where two sixteens have their least costs a fifth apart or more, and the mean cost of each would be
// higher by 0.6 or more with the other's.  Rendered and real captures that do not zoom have at most 0.3
// there.  Nothing where fewer than 20 pairs are within sixteen images.  O(pairs + images^2 / 64).
std::string ZoomedPart(const MapperInput& input);

}  // namespace cairn::reconstruct
