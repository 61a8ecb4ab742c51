#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "core/base/random.h"
#include "core/plan/floor_plan.h"
#include "runtime/beams/plan_rays.h"
#include "runtime/scans/carmen_log.h"

namespace cairn {

// Scans of half of the view around.
inline constexpr int kNumRandomBeams = 180;
inline constexpr double kRandomScanNoiseM = 0.02, kRandomScanRangeM = 20;

// A scan from a random place that sees at least three walls with half of its beams and stands 20 cm from
// walls; nothing where this place is no such.
inline std::optional<RangeScan> RandomScan(const FloorPlan& plan, const PlanRays& rays, Random* random) {
  const Eigen::Vector2d low = plan.Metres(plan.low), high = plan.Metres(plan.high);
  RangeScan scan;
  scan.first_angle_rad = -std::numbers::pi / 2;
  scan.step_rad = std::numbers::pi / kNumRandomBeams;
  const double x = random->Uniform(low.x(), high.x());
  const double y = random->Uniform(low.y(), high.y());
  scan.pose = {{x, y}, random->Uniform(-std::numbers::pi, std::numbers::pi)};
  std::vector<int32_t> walls;
  for (int i = 0; i < kNumRandomBeams; ++i) {
    const double angle = scan.pose.heading_rad + scan.first_angle_rad + i * scan.step_rad;
    const PlanRays::Hits hits =
        rays.Cast(scan.pose.position, {std::cos(angle), std::sin(angle)}, kRandomScanRangeM);
    double range = 2 * kRandomScanRangeM;
    if (hits.size > 0) {
      walls.push_back(hits.at[0].wall);
      range = hits.at[0].distance_m + random->Normal(0, kRandomScanNoiseM);
      if (range < 0.2) return std::nullopt;
    }
    scan.ranges_m.push_back(range);
  }
  if (std::ssize(walls) < kNumRandomBeams / 2) return std::nullopt;
  std::sort(walls.begin(), walls.end());
  if (std::unique(walls.begin(), walls.end()) - walls.begin() < 3) return std::nullopt;
  return scan;
}

}  // namespace cairn
