#pragma once

#include <vector>

#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

struct CloseTrianglesOptions {
  // Rotations around a triangle that come back to within this close it, degrees.  REQUIRES: > 0
  double max_error_deg = 2;
};

// How well other pairs bear each pair out: of the triangles of pairs that it is a side of, the part whose
// rotations close, a triangle counted for each choice among the rotations that explain a pair as well; few
// triangles say less than many, and a pair in none is doubtful.  In [0, 1); per pair [loop constraints after
// Zach, Klopschitz & Pollefeys, "Disambiguating visual relations using loop constraints", CVPR 2010; triplets
// as in Moulon, Monasse & Marlet, ICCV 2013].  Look-alikes contradict the way round; planes seen from
// straight ahead, whose two rotations no match tells apart, contradict everything.  Same result for any
// number of threads.  O(triangles).
std::vector<double> CloseTriangles(int num_images, const std::vector<ViewPair>& pairs,
                                   const CloseTrianglesOptions& options, int num_threads);

}  // namespace cairn::reconstruct
