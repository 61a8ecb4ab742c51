#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"

namespace cairn {

// A stretch of a wall that a point sees, from left to right of the wall's side as seen (the side lies left of
// start -> end, so counter-clockwise around the point).
struct VisibleStretch {
  LabelIdx label = 0;
  Eigen::Vector2d start, end;  // metres

  double Length() const { return (end - start).norm(); }
};

// Stretches of the walls of `labels` that are visible from a point, counter-clockwise, if only these walls
// hide one another.  With the label set of the point's region these are all visible stretches.  A label seen
// through several windows has as many stretches.  O(n log n + n k) for n pieces of their walls, k in
// one direction.
std::vector<VisibleStretch> VisibleStretches(const FloorPlan& plan, const std::vector<LabelIdx>& labels,
                                             const Eigen::Vector2d& place);

}  // namespace cairn
