#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/geometry/planar_pose.h"
#include "core/plan/floor_plan.h"
#include "runtime/laser/interpretation_tree.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// Whether a robot sees a point (floor frame): no wall stands more than `tolerance_m` before it, except walls
// on which it lies.  O(walls)
bool SeesPoint(const FloorPlan& plan, const PlanarPose& pose, const Eigen::Vector2d& point,
               double tolerance_m);

// Length of the segments that lie more than `tolerance_m` behind a wall at a pose, metres.  O(segments *
// walls)
double HiddenLength(const FloorPlan& plan, const std::vector<ScanSegment>& segments, const PlanarPose& pose,
                    double tolerance_m);

// Orders solutions by the length of the segments that support them less the length of those that contradict
// them: a laser does not see through walls, so a segment, matched or not, that lies behind a wall of the plan
// at the solution's pose contradicts it.  Ties: least rms.  Fills hidden_length_m, and fits the poses again
// with the uncertainty of where walls stand (sigma_wall_m, sigma_wall_deg).
void RankInterpretations(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                         const InterpretationTreeOptions& options, std::vector<Interpretation>* solutions);

}  // namespace cairn
