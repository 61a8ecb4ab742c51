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

}  // namespace cairn::reconstruct
