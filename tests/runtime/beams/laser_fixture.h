#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "core/plan/floor_plan.h"
#include "runtime/scans/beam.h"

namespace cairn {

// A room of 8 x 5 m with a niche, a pillar and a wall in it: it looks different from everywhere.
inline std::vector<PlanWall> OddRoom() {
  std::vector<PlanWall> walls;
  const std::vector<Eigen::Vector2d> outline = {{0, 0}, {8, 0}, {8, 3}, {7, 3},
                                                {7, 4}, {8, 4}, {8, 5}, {0, 5}};
  for (size_t i = 0; i < outline.size(); ++i)
    walls.push_back({outline[i], outline[(i + 1) % outline.size()]});
  walls.push_back({{2, 0}, {2, 2}});
  for (const auto& [a, b] : {std::pair<Eigen::Vector2d, Eigen::Vector2d>{{4, 3}, {4.5, 3}},
                             {{4.5, 3}, {4.5, 3.5}},
                             {{4.5, 3.5}, {4, 3.5}},
                             {{4, 3.5}, {4, 3}}})
    walls.push_back({a, b});
  return walls;
}

// The distance of the nearest wall in a direction; infinity: none.  Looks at all of them.
inline double NearestAlong(const std::vector<PlanWall>& walls, const Eigen::Vector2d& origin,
                           const Eigen::Vector2d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const PlanWall& wall : walls) {
    const Eigen::Vector2d along = wall.end - wall.start;
    const double turn = Cross(direction, along);
    const double share = Cross(wall.start - origin, direction) / turn;
    const double distance = Cross(wall.start - origin, along) / turn;
    if (share >= 0 && share <= 1 && distance > 0) nearest = std::min(nearest, distance);
  }
  return nearest;
}

// Beams of half the view around, one a degree, with noise; `max_range_m` where there is nothing so near.
inline std::vector<Beam> BeamsAt(const std::vector<PlanWall>& walls, const PlanarPose& pose, double sigma_m,
                                 Random* random, double max_range_m = 20) {
  std::vector<Beam> beams;
  for (int degree = -90; degree < 90; ++degree) {
    const Eigen::Vector2d direction(std::cos(RadFromDeg(degree)), std::sin(RadFromDeg(degree)));
    const double range = NearestAlong(walls, pose.position, Eigen::Rotation2Dd(pose.heading_rad) * direction);
    const bool met = range < max_range_m;
    beams.push_back({direction, met ? range + random->Normal(0, sigma_m) : max_range_m, met});
  }
  return beams;
}

}  // namespace cairn
