#pragma once

#include <vector>

#include <Eigen/Core>

#include "runtime/paths/link_space.h"

namespace cairn {

// A path of straight links in grid coordinates.
struct LinkedPath {
  int num_links = 0;                    // 0: there is no path
  std::vector<Eigen::Vector2d> points;  // from, turns, to
};

// A path with the fewest links of all in a space, from from() to to() [Suri, CVGIP 1986].
//
// Let R(k) be all places that k links reach.  What is in R(k + 1) and not in R(k) sees a window of R(k): a
// part of its border that is no wall.  Suri computes R(k + 1), in a polygon without holes, as what each
// window sees in the pocket behind it.  Here only windows are computed, so that holes and walls that
// stand free make no difference:
//
//   Each window of R(k + 1) begins at a corner w that R(k) has not and that sees a window of R(k).  It goes
//   from w straight away from an end of one of the intervals of directions in which w sees windows of R(k).
//
// For a point just beside a window sees R(k) on one side of it only; so on the line of the window
// back to R(k) a corner stands in the way on the other side, and from the last such corner the
// direction is the last one in which R(k) is seen.  If that corner were in R(k), both sides would see it.
//
// So windows are found breadth first over corners, each of which has its turn once.  All ends are taken,
// also such as are no windows: they lie in R(k + 1) all the same.  O(corners (segments log segments +
// windows)).
LinkedPath FindFewestLinks(const LinkSpace& space);

}  // namespace cairn
