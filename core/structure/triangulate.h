#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/camera/pixel_ray.h"
#include "core/geometry/pose.h"

namespace cairn {

// A ray to a scene point, from a posed camera of any model.
struct PosedRay {
  Pose cam_from_world;
  PixelRay ray;
};

struct TriangulateOptions {
  // Largest reprojection error of an observation that is kept, pixels.  REQUIRES: > 0
  double max_reprojection_error_px = 4.0;
  // Smallest angle between two of the rays that are kept, degrees.  REQUIRES: in (0, 180)
  double min_triangulation_angle_deg = 1.5;
  // Fewest observations of a point.  REQUIRES: >= 2
  int min_num_observations = 3;
};

enum class TriangulateOutcome { kOk, kFewObservations, kSmallAngle };

struct Triangulation {
  TriangulateOutcome outcome = TriangulateOutcome::kFewObservations;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2, for noise of one pixel in each coordinate
  std::vector<int> inliers;                              // indices of the rays kept, ascending
  double rms_error_px = 0;
};

// The point that most rays agree on: two-view hypotheses from pairs of rays spread over the track, the one
// with the most rays within the largest error wins (ties: smaller total error), then Gauss-Newton on the
// reprojection error of its rays.  No randomness.  O(pairs * rays), at most 15 pairs.
Triangulation Triangulate(const std::vector<PosedRay>& rays, const TriangulateOptions& options);

}  // namespace cairn
