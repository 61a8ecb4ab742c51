#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

struct PlanPathOptions {
  // Radius of the robot, metres.  REQUIRES: >= 0
  double radius_m = 0.2;
  // Search paths: about how many regions have their middles as looking places to choose from: the largest of
  // each cell of a grid over the plan.  REQUIRES: >= 1
  int max_num_places = 1500;
  // Search paths: share of the area that can be seen at all.  REQUIRES: in (0, 1]
  double seen_ratio = 1;
};
OptionTable DescribeOptions(PlanPathOptions* options);

struct PlanPath {
  std::vector<Eigen::Vector2d> points;  // floor frame, metres, start and goal included
  double length_m = 0;
  int num_links() const { return points.empty() ? 0 : static_cast<int>(points.size()) - 1; }
};

// All paths are planned over one roadmap (plan_roadmap.h): of any two places either all kinds find a way or
// none does.  A point robot (radius 0) may touch walls and walk along them; it never passes a joint.  Places
// count as the nearest points of the plan's grid there.

// The shortest path [Simsarian96 §4.1: over the adjacency graph of regions; there ways go from border to
// border, which finds no shortest one, and none where a border's middle is too near to a wall].  Exact for a
// point; plan_roadmap.h says how near to it for a disc.  From a place to itself: this one point, no links.
// Errors: InvalidArgument (options, a place outside of the domain), NoData (no way for this radius, a place
// nearer to a wall than it, or on a wall).
Result<PlanPath> FindPath(const PlanSpace& space, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                          const PlanPathOptions& options);

struct MinimumLinkPath {
  PlanPath path;
  // No path has fewer: proven, up to the rounding of doubles.
  int fewest_links = 0;
  bool is_optimal() const { return path.num_links() == fewest_links; }
};
// A path with the fewest straight links, which may turn anywhere (fewest_links.h), and a proof of how few
// they can be: the fewest of a robot that may go wherever this one may, and a little nearer to walls.  For a
// point the path keeps a few units of the grid away from walls, or turns at their corners; for a disc, the
// circle around a wall's end is a polygon outside of it for the path, and inside for the proof.  Where a way
// of fewer links needs what lies between, the path is not optimal or is not known to be.  Errors: as
// FindPath.
Result<MinimumLinkPath> FindMinimumLinkPath(const PlanSpace& space, const Eigen::Vector2d& from,
                                            const Eigen::Vector2d& to, const PlanPathOptions& options);

// Errors: InvalidArgument for a place outside of the domain, NoData where the robot does not fit.
Status CheckStands(const PlanSpace& space, const Eigen::Vector2d& place, double radius_m);
// A path over these points.
PlanPath MeasuredPath(std::vector<Eigen::Vector2d> points);

}  // namespace cairn
