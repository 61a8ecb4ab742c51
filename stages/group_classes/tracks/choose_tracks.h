#pragma once

#include <cstddef>
#include <vector>

#include "core/structure/triangulate.h"
#include "core/structure/union_matches.h"

namespace cairn::group_classes {

// At most 16 of a track's inliers, spread from the first to the last: k of them cost k^2, and say little
// more; both ends of a track, and all its passes, are what it joins.
std::vector<int> Spread(const std::vector<int>& inliers);

// The longest tracks that were triangulated, as many that every image has `num_keypoints` of them or all that
// it has; ties to the first.  `is_counted`: per image, whether it has to.  Indices of tracks, the longest
// first.
std::vector<size_t> ChooseTracks(const std::vector<Track>& tracks,
                                 const std::vector<Triangulation>& triangulations,
                                 const std::vector<char>& is_counted, int num_keypoints);

}  // namespace cairn::group_classes
