#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/geometry/pose.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"

namespace cairn {

struct PoseEstimate {
  Pose cam_from_world;
  std::vector<int> inliers;  // indices of measurements, ascending
  int num_iterations = 0;
};

// Pose from correspondences of which many are wrong: RANSAC over three points (P3P, OpenCV), truncated
// squared errors as score, each best pose so far refined over its inliers (LO-RANSAC: Chum, Matas, Kittler,
// "Locally Optimized RANSAC", 2003).  Same measurements and seed, same result.  Nothing when no pose has at
// least 4 inliers.
std::optional<PoseEstimate> EstimatePose(const std::vector<PoseMeasurement>& measurements,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed);

}  // namespace cairn
