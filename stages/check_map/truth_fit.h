#pragma once

#include <optional>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/similarity.h"

namespace cairn::check_map {

// A fix and the true pose of its camera.
struct FixAndTruth {
  Pose fix;    // cam_from_world in the map's frame
  Pose truth;  // cam_from_world in the truth's
};

// What the frames of map and truth differ by, so that a frame's error is told from a robot's.
struct TruthFit {
  Similarity truth_from_map;
  Pose truth_cam_from_cam;  // where the truth is of a body, or of another camera of the rig
  // Per fix, what remains: distance of the centres, m of the truth, and angle, degrees.
  std::vector<double> errors_m, errors_deg;
};

// Least squares over the similarity, and over the camera's offset where asked for, with Cauchy's loss in
// units of what remains; from the closed form of [Umeyama91] for the centres.  Nothing where there are fewer
// than 6 fixes, or where their places lie on a line or in a point: then a similarity is not determined.
std::optional<TruthFit> FitTruth(const std::vector<FixAndTruth>& fixes, bool with_offset);

}  // namespace cairn::check_map
