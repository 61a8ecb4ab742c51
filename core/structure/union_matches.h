#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/structure/scored_matches.h"

namespace cairn {

using Track = std::vector<TrackElement>;  // ascending, one per image

// Joins keypoints that match into tracks [Sala06 §VI-B: equivalence classes], most alike first.  A match that
// would put two keypoints of one image into a class is not followed: the class stays split there.  Counts
// such matches in `num_conflicts`.  Tracks of fewer than two keypoints are left out; ascending by first
// element.  O(matches log matches).  Errors: as ScoredMatches::Visit; none where all are in memory.
Result<std::vector<Track>> UnionMatches(ScoredMatches matches, int64_t* num_conflicts);

}  // namespace cairn
