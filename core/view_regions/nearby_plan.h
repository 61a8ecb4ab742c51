#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"

namespace cairn {

// A part of a plan, as an open plan of its own.
struct NearbyPlan {
  FloorPlan plan;
  std::vector<int32_t> walls;  // of the whole plan, ascending: wall i of the part is walls[i]
};

// The walls of a plan that come within `reach_m` of any of these places (metres), whole, and the box around
// them and around what lies within that of the places, inside of the plan's box.  A laser that sees r metres
// sees from any point within reach_m - r of a place what it sees there in the whole plan: regions can be
// derived near to where a robot may be, without those of the rest.  O(walls * places)
NearbyPlan PlanNear(const FloorPlan& plan, std::span<const Eigen::Vector2d> places, double reach_m);

}  // namespace cairn
