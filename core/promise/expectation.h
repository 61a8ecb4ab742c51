#pragma once

#include <vector>

#include "core/promise/expected_matches.h"
#include "core/promise/landmark_sights.h"
#include "core/promise/promise_model.h"

namespace cairn {

// What the classes marked in `keep` let expect of an image taken at a pose.
// `matches`: MatchModel::At that pose.  `depth`: ViewDistance::depth, which is how roughly the place is known
// without landmarks.
Expectation ExpectationOf(const LandmarkSights& sights, const std::vector<ClassMatch>& matches,
                          const std::vector<char>& keep, const Pose& cam_from_world, double focal,
                          double depth);

}  // namespace cairn
