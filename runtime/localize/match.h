#pragma once

#include <vector>

#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"

namespace cairn {

// Correspondences between the query and these landmarks, by mutual nearest descriptors and ratio test,
// ascending by keypoint.  REQUIRES: landmarks.packed
std::vector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                           const MatchOptions& options);

}  // namespace cairn
