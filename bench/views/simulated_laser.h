#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/random.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/scans/read_scans.h"

namespace cairn {

// A laser of a robot in a plan: 180 beams, a degree apart, ahead.
struct SimulatedLaser {
  static constexpr int kNumBeams = 180;
  double range_m = 0;
  double sigma_m = 0;       // of ranges
  double hidden_ratio = 0;  // share of beams that end before the wall
};

inline ScanView SimulatedScan(const SimulatedLaser& laser, const PlanRays& rays, const PlanarPose& pose,
                              Random* random) {
  RangeScan scan;
  scan.first_angle_rad = -std::numbers::pi / 2;
  scan.step_rad = std::numbers::pi / SimulatedLaser::kNumBeams;
  scan.max_range_m = laser.range_m;
  for (int i = 0; i < SimulatedLaser::kNumBeams; ++i) {
    const double angle = pose.heading_rad + scan.first_angle_rad + i * scan.step_rad;
    const PlanRays::Hits hits = rays.Cast(pose.position, {std::cos(angle), std::sin(angle)}, laser.range_m);
    double range = hits.size == 0 ? laser.range_m : hits.at[0].distance_m + random->Normal(0, laser.sigma_m);
    if (random->Uniform(0, 1) < laser.hidden_ratio) range *= random->Uniform(0.3, 1);
    scan.ranges_m.push_back(std::min(range, laser.range_m));
  }
  return ViewOf(scan, {});
}

}  // namespace cairn
