#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/base/pooled.h"
#include "core/geometry/pose.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"

namespace cairn {

inline constexpr uint64_t kRansacSeed = 0;  // fixed: an image always gives the same answer

struct PoseEstimate {
  Pose cam_from_world;
  PooledVector<int> inliers;  // indices of measurements, ascending
  int num_iterations = 0;
};

// Whether poses come from two points and up alone, as up is known better than an inlier; else from three as
// well, of which those that tilt the camera are left out.
bool UsesTwoPoints(std::span<const PoseMeasurement> measurements, const std::optional<UpMeasurement>& up,
                   const EstimateOptions& options);

// Pose from correspondences of which many are wrong: RANSAC over three points, or over two and up
// (core/geometry/minimal_pose.h); truncated squared errors as score, each best pose so far refined over its
// inliers (LO-RANSAC: Chum, Matas, Kittler, "Locally Optimized RANSAC", 2003).
// Same measurements and seed, same result.
//
// Up to so many poses, the best first: no two share more than nine tenths of the fewer inliers, and one
// that has a quarter fewer inliers than the best may not be found.  What is spent of `work` ends the search:
// those that are found by then.
PooledVector<PoseEstimate> EstimatePoses(std::span<const PoseMeasurement> measurements, int max_num_poses,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed, const std::optional<UpMeasurement>& up = std::nullopt,
                                         WorkBudget* work = nullptr);
// The best of them.  Nothing when no pose has at least 4 inliers.
std::optional<PoseEstimate> EstimatePose(std::span<const PoseMeasurement> measurements,
                                         const EstimateOptions& options, const RefineOptions& refine_options,
                                         uint64_t seed, const std::optional<UpMeasurement>& up = std::nullopt,
                                         WorkBudget* work = nullptr);
// The best of the measurements that are no inliers of a first.
std::optional<PoseEstimate> EstimateOtherPose(std::span<const PoseMeasurement> measurements,
                                              const PoseEstimate& first, const EstimateOptions& options,
                                              const RefineOptions& refine_options, uint64_t seed,
                                              const std::optional<UpMeasurement>& up = std::nullopt,
                                              WorkBudget* work = nullptr);

}  // namespace cairn
