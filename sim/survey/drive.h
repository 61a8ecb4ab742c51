#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "sim/render/building.h"

namespace cairn::sim {

struct DrivePose {
  Eigen::Vector2d position;  // metres
  double heading_rad = 0;    // counter-clockwise from +x: the direction of travel
};

// A smooth round trip through all rooms and corridors: from the middle of one to the nearest one not yet
// visited, along ways that keep away from walls, and back to the start; a pose every step_m of the way.
// Every pose keeps clearance_m.  Run 0 visits the places with the most space and prefers the middle of ways;
// other runs visit random places, by `seed`, along ways with random preferences.  Errors: NoData when a room
// cannot be entered with that clearance.
Result<std::vector<DrivePose>> PlanDrive(const Building& building, const SimulateOptions& options,
                                         uint64_t seed);

}  // namespace cairn::sim
