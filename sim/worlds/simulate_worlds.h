#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/options/options.h"
#include "core/world/world.h"

namespace cairn::sim {

// Draws random worlds seen from above, to try region algorithms on thousands of them: a perimeter polygon,
// polygonal obstacles, features on the walls of both, and stations on a lattice in the free space.
// Implements the simulator of [Sala06 §VI, Table I].  A feature is seen from a station that lies within its
// opening angle about the wall's inward normal, within its range, and with no wall between.  Chosen here,
// since the source does not give them: radii, sides of obstacles and numbers of features (options); the
// angular extent is the full opening; stations are the largest connected part of the lattice.
struct SimulateWorldsOptions {
  // Setting of the experiments: 1 rectangular and 2 rectangular with widely visible features, 3 irregular and
  // 4 irregular with widely visible ones [Sala06 §VI-A].  REQUIRES: in [1, 4]
  int setting = 1;
  // Number of features; 0 takes the setting's, with which about 100 are visible from a station (5400, 1700,
  // 5000, 1700).  REQUIRES: >= 0
  int num_features = 0;
  // Distance between stations [Sala06: 0.5].  REQUIRES: > 0
  double spacing_m = 0.5;
  // Mean distance of the perimeter's vertices from its middle (irregular), or half of its mean side
  // (rectangular) [Sala06: worlds average 40 m in diameter].  REQUIRES: > 2
  double radius_m = 20;
  // Range of the distance of an obstacle's vertices from its middle.  REQUIRES: > 0
  double min_obstacle_radius_m = 0.75;
  double max_obstacle_radius_m = 2.5;
  // Multiplies the floor's area and with it the numbers of obstacles and features, so that the number of
  // features visible from a station does not depend on the size.  REQUIRES: in [0.01, 10000]
  double area_scale = 1;
};
OptionTable DescribeOptions(SimulateWorldsOptions* options);

using Polygon = std::vector<Eigen::Vector2d>;  // counter-clockwise, simple

struct SimulatedFeature {
  Eigen::Vector2d position;
  Eigen::Vector2d normal;  // of the wall, into free space
  double opening_deg = 0;  // full
  double near_m = 0, far_m = 0;
};

// The plan from which a world is sampled.
struct WorldPlan {
  Polygon perimeter;
  std::vector<Polygon> obstacles;
  std::vector<SimulatedFeature> features;
};

// Draws a floor plan.  Same options and seed, same plan.
WorldPlan DrawFloorPlan(const SimulateWorldsOptions& options, uint64_t seed);

// Stations of the lattice through (0, 0) in free space, and what they see.
World SampleFloorPlan(const WorldPlan& plan, double spacing_m);

// DrawFloorPlan, then SampleFloorPlan.  Errors: InvalidArgument for a bad option, NoData when there is no
// free space.
Result<World> SimulateWorld(const SimulateWorldsOptions& options, uint64_t seed);

}  // namespace cairn::sim
