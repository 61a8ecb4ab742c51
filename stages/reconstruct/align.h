#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "core/geometry/similarity.h"

namespace cairn::reconstruct {

// A known position of a camera, with standard deviations per axis, metres.
struct PositionTarget {
  Eigen::Vector3d model = Eigen::Vector3d::Zero();  // the camera's centre in the reconstruction
  Eigen::Vector3d world = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Ones();
};

struct Alignment {
  Similarity world_from_model;
  std::vector<double> residuals_m;  // per target: distance between its aligned and its known position
  std::vector<bool> is_off;         // per target: more than three standard deviations away
  double scale_sigma_ratio = 0;     // standard deviation of the scale, as a part of it
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // about which it errs, world
};

// The similarity that best puts cameras at their known positions and their mean up along +z, robustly:
//   min sum_i rho( |(x_i - (s R c_i + t)) / sigma_i|^2 ) + rho( |R u - e_z|^2 / sigma_up^2 ),  Cauchy loss,
// from the best of the closed forms over pairs (with the cameras' up) and triples [Umeyama91] of targets.
// The scale errs about the targets' weighted centre m, where it does not move them all one way, by
//   sigma^2 = noise / sum_i |(x_i - m) / sigma_i|^2  over those within three standard deviations,
// noise the median of the squared residuals over chi-square's, at least 1: targets that err more than was
// said widen it.  The term in up determines what positions leave undetermined, such as the roll about a
// straight street. COLMAP's model_aligner has no such term and gives no residuals.  No randomness.  Errors:
// NoData for fewer than three targets, or targets less than twice their standard deviations from their common
// centre, which determine no scale.
Result<Alignment> AlignToPositions(const std::vector<PositionTarget>& targets,
                                   const Eigen::Vector3d& up_model, double up_sigma_deg);

// A distance between two cameras: as reconstructed, and as known in metres.
struct DistanceTarget {
  double model = 0;
  double world_m = 0;
};

struct DistanceScale {
  double scale = 1;        // median over the targets of known over reconstructed distance
  double sigma_ratio = 0;  // its standard deviation, as a part of it
};

// From known distances with this standard deviation, as a part of each; where they contradict each other by
// more, by the median absolute deviation, that counts.  Errors: NoData without a target with two cameras at
// different places.
Result<DistanceScale> ScaleFromDistances(const std::vector<DistanceTarget>& targets,
                                         double distance_sigma_ratio);

// Mean of the cameras' up directions (-y), of length 1; +z where they cancel out.
Eigen::Vector3d MeanUp(const std::vector<Pose>& cams_from_model);

// A frame of this scale with the first camera at its origin, the cameras' up along +z and the first camera's
// view along +x as far as it is level.  REQUIRES: not empty
Similarity LevelledFrame(const std::vector<Pose>& cams_from_model, double scale);
// The same with this direction, of length 1, along +z.
Similarity LevelledFrame(const std::vector<Pose>& cams_from_model, double scale, const Eigen::Vector3d& up);

}  // namespace cairn::reconstruct
