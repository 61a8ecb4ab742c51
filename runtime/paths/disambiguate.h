#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

struct DisambiguateOptions {
  // A stretch of wall tells two places apart if at least so much of it is seen from one only, metres.
  // REQUIRES: > 0
  double min_feature_m = 0.3;
  // Walls this close to each other, and this parallel, look the same.  REQUIRES: > 0
  double same_wall_m = 0.15;
  double same_wall_deg = 5;
  // What the robot does not see, metres.  REQUIRES: > 0
  double max_range_m = 20;
  // Radius of the robot, metres.  REQUIRES: >= 0
  double radius_m = 0.2;
  // Metres of path that are worth one metre more of distance to the telling feature.  REQUIRES: >= 0
  double cost_of_distance = 0.1;
  // Most regions to look from before giving up, those around a and around b together.  REQUIRES: >= 1
  int max_num_regions = 40000;
};
OptionTable DescribeOptions(DisambiguateOptions* options);

enum class DisambiguationOutcome {
  kFound = 0,
  kAlike = 1,  // of all regions that the robot can get to from either pose, nothing tells them apart
  kGaveUp = 2  // max_num_regions were looked from, and others were left: there may be something
};

// What tells whether a robot is at one of two places that its scan fits.
struct DisambiguationPlan {
  DisambiguationOutcome outcome = DisambiguationOutcome::kAlike;
  // 1: the views differ already, 2: after crossing a border of the region, 3: farther on; 0: nothing was
  // found.  What follows is of a plan that was found.
  int kind = 0;
  // Whether none costs less; false: max_num_regions were looked from before that was known.
  bool is_best = true;
  // The motion, if the robot is at a, and if it is at b: the same in the robot's frame, free of walls in
  // both.
  std::vector<Eigen::Vector2d> path_a, path_b;
  // The telling stretch of wall, as it lies if the robot is at a, and at b; it is there in one of the cases
  // only.
  bool feature_is_at_a = false;
  Eigen::Vector2d feature_start_a, feature_end_a, feature_start_b, feature_end_b;
  double path_length_m = 0;
  double distance_m = 0;  // of the feature from the end of the path
  int num_regions = 0;    // looked from, in any case
};

// Plans, before the robot moves, how to tell two poses apart that a scan fits [Simsarian96 §4].  Best-first
// over the adjacency graph around a and that around b at once, each motion carried along at the other pose:
// from each region's middle the two predicted views are compared, and the path that costs least, with what
// the distance to the telling feature costs, wins.  In case 1 the path leads towards the feature, as far as
// both poses allow.  Which of the two is called a does not matter.
// Errors: InvalidArgument (options; a pose outside of the domain, or without a heading), NoData (views that
// do not differ, and the robot does not fit at a pose: it cannot move).
Result<DisambiguationPlan> PlanDisambiguation(const PlanSpace& space, const PlanarPose& a,
                                              const PlanarPose& b, const DisambiguateOptions& options);

}  // namespace cairn
