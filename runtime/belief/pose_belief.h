#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/planar_pose.h"
#include "core/options/options.h"

namespace cairn {

// A pose on the floor and how well it is known: x, y (m), heading (rad), in the frame of the floor.
struct UncertainPlanarPose {
  PlanarPose pose;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

// What stands on it at `b_from_c`, as a camera or a laser on a robot.
UncertainPlanarPose operator*(const UncertainPlanarPose& body, const PlanarPose& b_from_c);

// One place where a robot may be; of what one scan or image shows, or of a belief.
struct PossiblePlace : UncertainPlanarPose {
  double probability = 0;
};

struct PoseBeliefOptions {
  // What one look says is wrong this often, whatever it says of itself: other places are kept with this
  // share of their probability.  REQUIRES: in (0, 1)
  double surprise_ratio = 0.02;
  // From look to look, the chance that the robot was carried elsewhere, or was elsewhere all along.
  // REQUIRES: in (0, 1)
  double lost_ratio = 0.001;
  // Places less probable than this are given up.  REQUIRES: in (0, 1)
  double least_probability = 1e-6;
  // The most probable are kept.  REQUIRES: > 0
  int max_num_places = 200;
};

OptionTable DescribeOptions(PoseBeliefOptions* options);

// Where a robot is on a floor, as far as it is known: a mixture of Gaussians, and a share for being anywhere
// else on it.  In the beginning it may be anywhere.  Wheels move it, what is seen selects among its places
// and adds others (a Gaussian sum filter: Alspach and Sorenson, 1972).  Scans and images count alike.
// Deterministic.
class PoseBelief {
 public:
  // `area_m2`: of the floor.  REQUIRES: > 0
  explicit PoseBelief(double area_m2, const PoseBeliefOptions& options = {})
      : area_m2_(area_m2), options_(options) {}

  // The robot moved: its pose now in the frame that it had before; the covariance is in that frame.
  void Move(const UncertainPlanarPose& next_from_last);

  // A look that says by itself, had the robot been anywhere, that it is at one of these places; what their
  // probabilities lack of 1 is for a place that the look does not know.  What is not finite is left out;
  // probabilities of more than 1 in all are made 1.
  void Update(std::span<const PossiblePlace> told);

  // Moves places to those that a look shows near to them, without another word on which place it is: as a
  // look from where the last one was taken, which errs as that did.  Both are known no better than by one.
  void Correct(std::span<const PossiblePlace> seen);

  // The most probable first; with elsewhere() they sum to 1.
  const std::vector<PossiblePlace>& places() const { return places_; }
  double elsewhere() const { return elsewhere_; }

 private:
  void Tidy();

  double area_m2_;
  PoseBeliefOptions options_;
  std::vector<PossiblePlace> places_;
  double elsewhere_ = 1;
};

}  // namespace cairn
