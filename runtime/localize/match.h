#pragma once

#include <vector>

#include "core/geometry/pose.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {

// Correspondences between the query and these landmarks, by mutual nearest descriptors and ratio test,
// ascending by keypoint.  REQUIRES: landmarks.packed
std::vector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                           const MatchOptions& options);

// Landmarks that should be visible given these (ascending): those seen in the survey images that share most
// of them, ascending.  Errors: as Map::Landmarks.
Result<std::vector<LandmarkIdx>> CovisibleLandmarks(const Map& map, const std::vector<LandmarkIdx>& seen,
                                                    const MatchOptions& options);

}  // namespace cairn
