#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

// Nodes of a plan joined by free straight links: places that are asked for, and points around the corners of
// walls where a robot of one radius turns.  It is the visibility graph of the walls grown by the robot
// [Lozano-Perez & Wesley, CACM 1979]: if there is a way at all, there is one over these nodes, and the
// shortest is among them.  All kinds of paths are planned over it, so that they agree on whether there
// is a way.
//
// A point robot (radius 0) turns at the corners themselves.  It may touch walls and walk along them, but
// passes no joint: a link that ends at a corner ends on one side of the walls there.  Exact.
//
// A disc turns about a corner on a circle; the polygon around it here has a point every 22.5 degrees.  A way
// that is found is free; a passage less than 2 % wider than the robot may be missed, and a path may be longer
// by 2 % of its turns.
class PlanRoadmap {
 public:
  // The places are nodes 0, 1, ...; a place where the robot does not fit (radius 0: on a wall) has no links.
  // `space` outlives this.
  PlanRoadmap(const PlanSpace& space, double radius_m, const std::vector<Eigen::Vector2d>& places);

  int num_nodes() const { return static_cast<int>(nodes_.size()); }
  const Eigen::Vector2d& place(int node) const { return nodes_[node].place; }
  std::vector<Eigen::Vector2d> Places(const std::vector<int>& nodes) const;
  // Whether the robot may go straight from one to the other.
  bool AreJoined(int a, int b) const;
  // The nodes of the shortest way; empty: there is none.  A* with the straight distance.
  std::vector<int> ShortestWay(int from, int to) const;

 private:
  struct Node {
    Eigen::Vector2d place;
    bool fits = true;
    int32_t corner = -1;  // of PlanSpace::corners(); -1: of none
    // Where the links to the points before and after it on a corner's polygon touch the circle.
    Eigen::Vector2d rim_before = Eigen::Vector2d::Zero(), rim_after = Eigen::Vector2d::Zero();
  };
  void AddCorners();
  bool FollowsRim(const Node& node, const Eigen::Vector2d& direction) const;
  unsigned SidesAt(const Node& node, const Eigen::Vector2d& towards, bool leaves) const;

  const PlanSpace& space_;
  const double radius_m_;
  std::vector<Node> nodes_;
};

}  // namespace cairn
