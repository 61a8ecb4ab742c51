#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/geometry/planar_pose.h"
#include "core/plan/floor_plan.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// Whether a robot sees a point (floor frame): no wall stands more than `tolerance_m` before it, but such on
// which it lies.  O(walls)
bool SeesPoint(const FloorPlan& plan, const PlanarPose& pose, const Eigen::Vector2d& point,
               double tolerance_m);

// Orders solutions by the length of the segments that speak for them less the length of those against them:
// a laser does not see through walls, so what it saw and what at the solution's pose lies behind a wall of
// the plan, matched or not, contradicts it.  Ties: least rms.  Fills hidden_length_m, and fits the poses
// again with walls that stand only about where the plan says (sigma_wall_m, sigma_wall_deg).
void RankInterpretations(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                         const InterpretationTreeOptions& options, std::vector<Interpretation>* solutions);

}  // namespace cairn
