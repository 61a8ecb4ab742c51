#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "core/plan/views.h"
#include "runtime/scans/range_scan.h"
#include "runtime/track/camera_motion.h"
#include "tests/install/poster_room.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {

// The room of the posters with walls of its own, through which a robot drives with a laser, along the row of
// survey images:
//
//          x = -5                                     3
//   2.5    +------------------------------------------+
//          |              +--+                     +--+
//          |              +--+  0.5 to 1           +--+
//     0    |    > > > >  the way, from -4 to -2.8     |
//          |          | -0.5                          |
//  -2.5    +----------+-------------------------------+
//                    -3                 the posters hang at x = 3
//
// Beams go all around, one every 2 degrees from behind; those of more than 6 m meet nothing.
inline std::vector<PlanWall> LaserRoomWalls() {
  std::vector<PlanWall> walls = OddRoom();
  for (PlanWall& wall : walls) {
    for (Eigen::Vector2d* end : {&wall.start, &wall.end}) *end += Eigen::Vector2d(-5, -2.5);
  }
  return walls;
}

// Loose walls: no regions.
inline Views LaserRoomPlan() {
  Views views;
  FloorPlan& plan = views.plan;
  plan.origin = {-6, -3.5};
  plan.grid_m = 0.01;
  plan.high = {1000, 700};
  plan.walls = LaserRoomWalls();
  for (int32_t wall = 0; wall < plan.num_walls(); ++wall) {
    for (const Eigen::Vector2d& end : {plan.walls[wall].start, plan.walls[wall].end}) {
      const Eigen::Vector2d at = plan.Grid(end);
      plan.vertices.push_back({std::lround(at.x()), std::lround(at.y())});
    }
    plan.pieces.push_back({2 * wall, 2 * wall + 1, wall});
  }
  return views;
}

inline MapRows LaserRoomRows() {
  MapRows rows = PosterRoom().rows();
  rows.views = LaserRoomPlan();
  return rows;
}

inline constexpr double kLaserRangeM = 6;

// What a laser there sees, with noise of 1 cm.
inline RangeScan LaserScanAt(const PlanarPose& laser, Random* random) {
  RangeScan scan;
  scan.first_angle_rad = -std::numbers::pi;
  scan.step_rad = RadFromDeg(2);
  scan.max_range_m = kLaserRangeM;
  const std::vector<PlanWall> walls = LaserRoomWalls();
  for (size_t i = 0; i < 180; ++i) {
    const double angle = laser.heading_rad + scan.AngleOf(i);
    const double range = NearestAlong(walls, laser.position, {std::cos(angle), std::sin(angle)});
    scan.ranges_m.push_back(std::min(kLaserRangeM, range + random->Normal(0, 0.01)));
  }
  return scan;
}

// From one scan to the next: ahead, and a turn to the left.
struct LaserStep {
  FloorMotion moved;
  PlanarPose robot;
  RangeScan scan;
};

// Six scans, 24 cm apart, with turns to and fro; the wheels err by a twentieth.
inline std::vector<LaserStep> LaserDrive() {
  Random random(7);
  std::vector<LaserStep> steps;
  PlanarPose robot{{-4, 0}, 0.1};
  for (int i = 0; i < 6; ++i) {
    LaserStep step;
    if (i > 0) {
      const FloorMotion moved{{0.24, 0.01}, i % 2 == 0 ? 0.2 : -0.2};
      robot = robot * PlanarPose{moved.way_m, moved.turn_left_rad};
      step.moved = {1.05 * moved.way_m, 0.95 * moved.turn_left_rad};
    }
    step.robot = robot;
    step.scan = LaserScanAt(robot, &random);
    steps.push_back(std::move(step));
  }
  return steps;
}

}  // namespace cairn
