#pragma once

#include <span>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/belief/pose_belief.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

class SurveyedLooks;  // runtime/looks/surveyed_looks.h

struct NextLookOptions {
  // Radius of the robot, metres; less at a pose where it would not fit, as it stands there.  REQUIRES: >= 0
  double radius_m = 0.2;
  // Distance beyond which the laser sees nothing, metres.  REQUIRES: > 0
  double view_range_m = 20;
  // The angle that it sees, degrees, half of it to either side.  REQUIRES: in (0, 360]
  double view_deg = 180;
  // Ranges that differ by less than this, metres, are the same.  REQUIRES: > 0
  double same_range_m = 0.3;
  // Looks are planned at places so far from each other, metres.  REQUIRES: > 0
  double step_m = 0.5;
  // No farther away than this, by the way to them, metres.  REQUIRES: > 0
  double reach_m = 40;
  // Hypotheses of less than this are left out, and the most probable are looked at.
  double least_probability = 0.01;
  int max_num_hypotheses = 30;
};
OptionTable DescribeOptions(NextLookOptions* options);

enum class NextLookOutcome {
  kFound = 0,
  kAlike = 1,       // no look that the robot can get to, whichever pose is its own, tells any two apart
  kOutOfReach = 2,  // no look within reach_m does, and there are others beyond it
  kOnePlace = 3     // there is but one
};

// Where a robot goes to learn at which of several places it is, and what it then knows.
struct NextLook {
  NextLookOutcome outcome = NextLookOutcome::kAlike;
  // Where the robot may stand: the hypotheses, the most probable first; one that is not determined
  // (IsDetermined) stands for several places along the direction in which it is not known.
  std::vector<PossiblePlace> places;
  std::vector<int> hypotheses;  // of each of them, as an index into those given
  // The motion, in the robot's frame: the same wherever it is, and free of walls at each of the places.
  // One point, the origin: it turns only.
  std::vector<Eigen::Vector2d> path;
  double heading_rad = 0;  // to look along, in the robot's frame before it moves
  double length_m = 0;
  // Until one is left, or no look tells more apart: how far the robot drives on average, about.
  double expected_length_m = 0;
  // For each of `places`, if it is the right one: those that the look leaves, itself included, as indices
  // into `places`, ascending.
  std::vector<std::vector<int>> left;
  // Pairs of `places` that no look within reach tells apart.
  std::vector<std::pair<int, int>> alike;
  int num_looks = 0;  // that were compared
};

// Plans, before the robot moves, the next look that tells n poses apart: of all places that it gets to
// without touching a wall at any of them, what the laser would measure at each pose is compared with what it
// would at each other, and so is what the survey's images say that a camera would see.  The look with the
// least expected way in all is taken: to it, and on from there, each time to the look that tells most apart
// for its way.  A place along a corridor is one of several that are told apart.  (After Dudek, Romanik and
// Whitesides: Localizing a robot with minimum travel, SIAM J. Comput. 27, 1998, whose strategy goes to the
// nearest place that rules any hypothesis out; for two poses [Simsarian96 §4.2].)  The robot looks, and asks
// again with what is left.  Reads the plan's walls only. `images`: null without a camera.  Deterministic.
// Errors: InvalidArgument (options, a hypothesis that is not finite), NoData (no hypothesis is probable
// enough; a pose outside of the plan's box or on a wall).
Result<NextLook> PlanNextLook(const PlanSpace& space, std::span<const PossiblePlace> hypotheses,
                              const SurveyedLooks* images, const NextLookOptions& options, int num_threads);

}  // namespace cairn
