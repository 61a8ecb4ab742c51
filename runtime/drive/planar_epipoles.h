#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"

namespace cairn {

// The epipoles of two images of one camera that moves over a level floor and looks ahead, from matched pixels
// alone.  Seen from above, robot and target with their headings; angles counter-clockwise:
//
//      psi: bearing of the target's centre in the current camera      --->  target, heading = +x
//      phi: bearing of the current centre in the target's camera       \.
//      rho: distance                                                phi \ rho
//      heading - heading of the target = turn = phi + pi - psi           \.
//                                                                   psi   \.  robot
//
// Bearings to the left are positive, so the epipoles lie at columns cx - f tan(psi) of the current image and
// cx - f tan(phi) of the target's.  With (X, Y) the normalised coordinates of a point, right and down, and
// delta = phi + pi the way to the target in the target's frame, the point's distance from the baseline,
// in units of its height, is the same from both ends:
//
//   Y_t (X_c cos psi + sin psi) = Y_c (X_t cos delta + sin delta)
//
// This is the epipolar constraint of an essential matrix with two unknowns instead of five.  A camera whose
// focal length is f times an unknown 1 / kappa has kappa X_c, kappa X_t instead: a third unknown, known
// beforehand to some percent.  Matches determine it where they can, otherwise the prior does: the epipoles
// are right even with a wrong focal length.  Without a baseline only psi is arbitrary, the turn is not.
// Points of a single vertical wall (no floor, no ceiling) agree with two motions, as a plane does with two
// essential matrices; either is returned.  Points at the camera's height carry no information.
struct PlanarEpipolesOptions {
  // Standard deviation of a matched pixel.  REQUIRES: in [0.01, 10]
  double noise_px = 1;
  // The assumed focal length over the true one, as far as is known.  REQUIRES: in [0.2, 5]
  double focal_ratio = 1;
  // Standard deviation of that.  REQUIRES: in [0.001, 0.5]
  double focal_error_ratio = 0.12;
  // Minimum number of matches that agree, and minimum share of all.  REQUIRES: >= 4, in [0, 1]
  int min_num_inliers = 12;
  double min_inlier_ratio = 0.3;
  // Least standard deviation of the inliers in the images: in one spot they carry no
  // information.  REQUIRES: >= 0
  double min_spread_px = 8;
  // Pairs of matches that are tried.  REQUIRES: in [1, 100000]
  int num_samples = 100;
  int seed = 0;
};
OptionTable DescribeOptions(PlanarEpipolesOptions* options);

// A match in normalised image coordinates (x/z, y/z) of the assumed camera.
struct RayPair {
  Eigen::Vector2d current, target;
};

struct PlanarEpipoles {
  double psi_rad = 0, phi_rad = 0;  // [-pi, pi]
  double turn_rad = 0;              // heading minus the target's, [-pi, pi]
  double focal_ratio = 1;           // kappa: assumed / true focal length
  double focal_error_ratio = 0;     // standard deviation of it
  // rho over the median distance of the inliers from the target: >= 0; metres are not known.  Gives the
  // distance where the scene's size is roughly known; 0 means that the target is reached.
  double distance_ratio = 0;
  std::vector<char> is_inlier;  // per match
  int num_inliers = 0;

  // Where the robot stands in the target's frame (x ahead, y left), in units of that median distance.
  PlanarPose PoseInTarget() const {
    return {distance_ratio * Eigen::Vector2d(std::cos(phi_rad), std::sin(phi_rad)), turn_rad};
  }
};

// Samples of two matches with kappa among five values, the three best brought to the least Sampson error over
// their inliers; which end is ahead follows from the parallax.  `previous` (may be null) is tried as well.
// `focal_px` is of the assumed camera and scales the errors.  Pairs that are not finite are outliers.
// O(num_samples * pairs).  Errors: InvalidArgument (options), NoData (too few matches or inliers, or in one
// spot; says which).
Result<PlanarEpipoles> EstimatePlanarEpipoles(const std::vector<RayPair>& pairs, double focal_px,
                                              const PlanarEpipolesOptions& options,
                                              const PlanarEpipoles* previous);

}  // namespace cairn
