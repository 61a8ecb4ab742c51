#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

struct DisambiguateOptions {
  // A stretch of wall tells two places apart if at least this length of it is seen from only one of them,
  // metres.  REQUIRES: > 0
  double min_feature_m = 0.3;
  // Walls closer to each other than this, m, and with directions closer than this, degrees, look the
  // same.  REQUIRES: > 0
  double same_wall_m = 0.15;
  double same_wall_deg = 5;
  // Distance beyond which the robot sees nothing, metres.  REQUIRES: > 0
  double max_range_m = 20;
  // Radius of the robot, metres.  REQUIRES: >= 0
  double radius_m = 0.2;
  // Metres of path that count as much as one metre of distance to the distinguishing feature.  REQUIRES: >= 0
  double cost_of_distance = 0.1;
  // Most regions to look from before giving up, those around a and around b together.  REQUIRES: >= 1
  int max_num_regions = 40000;
};
OptionTable DescribeOptions(DisambiguateOptions* options);

enum class DisambiguationOutcome {
  kFound = 0,
  kAlike = 1,  // no region that the robot can reach from either pose tells them apart
  kGaveUp = 2  // max_num_regions were tried, and others were left, which may tell them apart
};

// How a robot finds out at which of two places it is that both fit its scan.
struct DisambiguationPlan {
  DisambiguationOutcome outcome = DisambiguationOutcome::kAlike;
  // 1: the views differ already, 2: after crossing a border of the region, 3: farther on; 0: nothing was
  // found.  The fields below describe a plan that was found.
  int kind = 0;
  // Whether no plan costs less; false: max_num_regions were tried before that was known.
  bool is_best = true;
  // The motion, if the robot is at a, and if it is at b: the same in the robot's frame, free of
  // walls in both.
  std::vector<Eigen::Vector2d> path_a, path_b;
  // The distinguishing stretch of wall, in its place if the robot is at a, and if at b; it exists in only one
  // of the cases.
  bool feature_is_at_a = false;
  Eigen::Vector2d feature_start_a = Eigen::Vector2d::Zero(), feature_end_a = feature_start_a,
                  feature_start_b = feature_start_a, feature_end_b = feature_start_a;
  double path_length_m = 0;
  double distance_m = 0;  // of the feature from the end of the path
  int num_regions = 0;    // regions that were tried, also where nothing was found
};

// Plans, before the robot moves, how to tell two poses apart that a scan fits [Simsarian96 §4.2].  Best-first
// over the adjacency graph around a and that around b at once, each motion carried along at the other pose:
// from each region's middle the two predicted views are compared, and the path of least cost, including the
// distance to the distinguishing feature, wins.  In case 1 the path leads towards the feature, as far as both
// poses allow.  The result does not depend on which of the two is called a.  Errors: InvalidArgument
// (options; a pose outside of the domain, or without a heading), NoData (the views do not differ, and the
// robot cannot move because it does not fit at a pose).
Result<DisambiguationPlan> PlanDisambiguation(const PlanSpace& space, const PlanarPose& a,
                                              const PlanarPose& b, const DisambiguateOptions& options);

// The same in a plan without regions: they are derived (core/view_regions/derive_views.h) from the walls near
// to the two poses, and from more of them until the motion and all that is seen along it lie among them.
// Errors: those of DeriveViews, too.
Result<DisambiguationPlan> PlanDisambiguation(const FloorPlan& plan, const PlanarPose& a, const PlanarPose& b,
                                              const DisambiguateOptions& options, int num_threads,
                                              int64_t memory_mib, Progress& progress);

}  // namespace cairn
