#pragma once

#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/colmap/colmap_database.h"
#include "core/features/features.h"

namespace cairn {

// A keypoint of an image, by contiguous image index.
struct TrackElement {
  int32_t image_idx = 0;
  KeypointIdx keypoint_idx = 0;
  friend bool operator==(const TrackElement&, const TrackElement&) = default;
  friend auto operator<=>(const TrackElement&, const TrackElement&) = default;
};
using Track = std::vector<TrackElement>;  // ascending, one per image

// A verified match between two images, and how alike its descriptors are (larger is better).
struct ScoredMatch {
  TrackElement element1;
  TrackElement element2;
  int32_t dot_product = 0;
};

// Joins keypoints that match into tracks [Sala06 §VI-B: equivalence classes], most alike first.  A match that
// would put two keypoints of one image into a class is not followed: the class stays split there.  Counts
// such matches in `num_conflicts`.  Tracks of fewer than two keypoints are left out; ascending by first
// element.  num_keypoints[i]: number of keypoints of image i.  O(matches log matches).
std::vector<Track> UnionMatches(const std::vector<int>& num_keypoints, std::vector<ScoredMatch> matches,
                                int64_t* num_conflicts);

}  // namespace cairn
