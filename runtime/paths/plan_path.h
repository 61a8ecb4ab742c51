#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

struct PlanPathOptions {
  // Radius of the robot, metres.  REQUIRES: >= 0
  double radius_m = 0.2;
  // About how many regions have their middles as turning and looking places: the largest of each cell of a
  // grid over the plan.  REQUIRES: >= 1
  int max_num_places = 1500;
  // Search paths: share of the area that can be seen at all, counted by cells of that grid.
  // REQUIRES: in (0, 1]
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

// A path with few straight links: breadth first over the places seen from the start, then from those, and so
// on, with turns in the middles of regions and around the corners of walls.  No path with turns at such
// places only has fewer links; a path with turns elsewhere may.  Errors: as FindPath.
Result<PlanPath> FindMinimumLinkPath(const PlanSpace& space, const Eigen::Vector2d& from,
                                     const Eigen::Vector2d& to, const PlanPathOptions& options);

struct SearchPath {
  PlanPath path;
  std::vector<Eigen::Vector2d> places;  // to look around from, in the order of the path
  double seen_area_m2 = 0, reachable_area_m2 = 0;
};
// A path from which every point is seen: looking places chosen greedily by the area that they add, visited in
// the order of a tour that 2-opt has shortened.  A region counts as seen when its middle and its corners are;
// in plans of more than max_num_places regions the largest of each cell stands for the others there.  Errors:
// as FindPath.
Result<SearchPath> FindSearchPath(const PlanSpace& space, const Eigen::Vector2d& from,
                                  const PlanPathOptions& options);

}  // namespace cairn
