#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/ids.h"

namespace cairn {

// A keypoint of an image, by contiguous image index.
struct TrackElement {
  int32_t image_idx = 0;
  KeypointIdx keypoint_idx = 0;
  friend bool operator==(const TrackElement&, const TrackElement&) = default;
  friend auto operator<=>(const TrackElement&, const TrackElement&) = default;
};
using Track = std::vector<TrackElement>;  // ascending, one per image

// Verified matches between images, with how alike their descriptors are.  There are millions: one takes
// twelve bytes.
class ScoredMatches {
 public:
  // num_keypoints[i]: number of keypoints of image i.
  explicit ScoredMatches(const std::vector<int>& num_keypoints);
  // Makes room for so many.
  void Reserve(size_t num_matches) { matches_.reserve(num_matches); }
  // A larger dot product is more alike.
  void Add(const TrackElement& element1, const TrackElement& element2, int32_t dot_product);

 private:
  friend std::vector<Track> UnionMatches(ScoredMatches matches, int64_t* num_conflicts);
  struct Match {
    int32_t keypoint1, keypoint2;  // counted over all images
    int32_t dot_product;
  };
  std::vector<int32_t> first_keypoint_;  // per image; then the number of all
  std::vector<Match> matches_;
};

// Joins keypoints that match into tracks [Sala06 §VI-B: equivalence classes], most alike first.  A match that
// would put two keypoints of one image into a class is not followed: the class stays split there.  Counts
// such matches in `num_conflicts`.  Tracks of fewer than two keypoints are left out; ascending by first
// element.  O(matches log matches).
std::vector<Track> UnionMatches(ScoredMatches matches, int64_t* num_conflicts);

}  // namespace cairn
