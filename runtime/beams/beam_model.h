#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/geometry/planar_pose.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/scans/beam.h"

namespace cairn {

struct BeamModelOptions {
  // How far walls stand from where the plan says, each independently: standard deviation of their offset,
  // metres, and of their direction, degrees.
  double sigma_wall_m = 0;
  double sigma_wall_deg = 0;
};

// What beams say about a pose.
struct BeamEvidence {
  double log_likelihood = 0;
  double sigma_m = 0;  // of ranges, that under which it is most
  // Of the beams that met something: those that likelier met a wall of the plan than not.
  double explained_ratio = 0;
};

// A pose, and what beams say about it.
struct WeighedPose {
  PlanarPose pose;
  BeamEvidence evidence;
  bool is_expected = false;  // it is, or is the same as, one that was looked for where it was expected
};

// What a laser measures at a pose in a plan: a beam ends at the first wall in its way, or before it at
// something that the plan does not show, or goes through (glass, a door) to the walls behind, or anywhere
// (after Thrun, Burgard and Fox: Probabilistic Robotics, 6.3).  How well ranges fit walls is not known
// beforehand: a plan may be exact or drawn by hand.
class BeamModel {
 public:
  // `walls` and `rays` outlive this.
  BeamModel(const std::vector<PlanWall>& walls, const PlanRays& rays, const BeamModelOptions& options)
      : walls_(walls), rays_(rays), options_(options) {}

  // O(beams * what lies along them)
  BeamEvidence Weigh(const std::vector<Beam>& beams, const PlanarPose& pose) const;

  // Log-likelihood in a plan without walls.
  double WeighWithoutWalls(const std::vector<Beam>& beams) const;

  // The pose near to another at which beams end at walls: Gauss-Newton with the wall that each beam most
  // likely met, at most 3 `sigma_m` off.
  PlanarPose Refine(const std::vector<Beam>& beams, double sigma_m, const PlanarPose& pose) const;

  // Of a pose that beams were refined to: x, y (m), heading (rad).  Beams on one wall share what it is off.
  Eigen::Matrix3d Covariance(const std::vector<Beam>& beams, double sigma_m, const PlanarPose& pose) const;

 private:
  struct Match;
  void FindMatches(const std::vector<Beam>& beams, double sigma_m, const PlanarPose& pose,
                   std::vector<Match>* matches) const;

  const std::vector<PlanWall>& walls_;
  const PlanRays& rays_;
  const BeamModelOptions options_;
};

}  // namespace cairn
