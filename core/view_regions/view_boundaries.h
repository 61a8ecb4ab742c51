#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/floor_plan.h"
#include "core/view_regions/wall_rays.h"

namespace cairn {

// The change of the number of windows through which a label is seen.
struct WindowChange {
  LabelIdx label = 0;
  int32_t windows = 0;
};

// A line along which the view changes [Simsarian96 §2.2 step I, §2.2 step III].
struct ViewBoundary {
  Eigen::Vector2d start, end;  // grid coordinates
  // Crossing from the right of start -> end to its left.
  std::vector<WindowChange> changes;
};

// All view boundaries of a plan.
//
// A label set contains the sides of walls that a point in general position sees.  Through gaps between other
// walls one side may be seen in several windows, so windows are counted, and a label is visible while it has
// one.  (In a polygon without holes there is never more than one: crossing into the light side of a boundary
// adds its label, crossing into the dark side drops it, as the source has it.)
//
// The view changes only along lines through vertices that see each other.  On such a line, between two
// neighbouring vertices of it, everything that changes lies straight ahead or straight behind: the vertices
// in that direction up to where the line is blocked change their order of angle, and the windows between them
// are read off, exactly, from the walls at each.  That covers the source's cases (a) to (c), any number of
// vertices in one line, walls along the line (seen edge-on), and walls that are seen from both sides.
//
// No wall lies in the inside of a boundary.  Both ends of a boundary lie on walls, or on the domain's border.
// Deterministic for any number of threads.  O(n^2) rays.  `stride`: finds only those that begin at every
// stride-th vertex, a sample of all.  Errors: Cancelled, Failed (more than `max_num`; no more are kept).
Result<std::vector<ViewBoundary>> FindViewBoundaries(const FloorPlan& plan, const WallRays& rays, int stride,
                                                     int64_t max_num, int num_threads, Progress& progress);

}  // namespace cairn
