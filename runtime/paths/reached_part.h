#pragma once

#include <vector>

#include <Eigen/Core>

#include "runtime/paths/plan_space.h"

namespace cairn {

// Where the middle of a robot can get to from a place that it fits at.  The same as over a roadmap
// (plan_roadmap.h), which says how near a passage may be to the radius.
class ReachedPart {
 public:
  // `space` outlives this.
  ReachedPart(const PlanSpace& space, double radius_m, const Eigen::Vector2d& from);

  bool Contains(const Eigen::Vector2d& place) const;
  // Of all places in it, m2.  For a point exact; for a disc counted on a lattice of some 40,000 points.
  double Area() const;

 private:
  const PlanSpace& space_;
  const double radius_m_;
  std::vector<bool> is_reached_face_;    // for a point
  std::vector<Eigen::Vector2d> places_;  // for a disc: nodes of the roadmap
};

// The connected parts of the floor for a point, a number for each region, ascending in their order.
std::vector<int> ConnectedFloor(const PlanSpace& space);

}  // namespace cairn
