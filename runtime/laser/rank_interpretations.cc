#include "runtime/laser/rank_interpretations.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"
#include "runtime/laser/pairing.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr int kNumSamples = 8;  // of a segment

}  // namespace

double HiddenLength(const FloorPlan& plan, const std::vector<ScanSegment>& segments, const PlanarPose& pose,
                    double tolerance_m) {
  double hidden = 0;
  for (const ScanSegment& segment : segments) {
    for (int i = 0; i < kNumSamples; ++i) {
      const Vec2 point = segment.start + (i + 0.5) / kNumSamples * (segment.end - segment.start);
      if (!SeesPoint(plan, pose, pose.FloorFromRobot(point), tolerance_m))
        hidden += segment.Length() / kNumSamples;
    }
  }
  return hidden;
}

bool SeesPoint(const FloorPlan& plan, const PlanarPose& pose, const Vec2& point, double tolerance_m) {
  const Vec2 ray = point - pose.position;
  const double reach = ray.norm();
  for (const PlanWall& wall : plan.walls) {
    const double side_a = Cross(ray, wall.start - pose.position);
    const double side_b = Cross(ray, wall.end - pose.position);
    if ((side_a > 0) == (side_b > 0)) continue;
    const Vec2 hit = wall.start + (wall.end - wall.start) * (side_a / (side_a - side_b)) - pose.position;
    const double distance = hit.dot(ray) / reach;
    if (distance > 0 && distance < reach - tolerance_m &&
        PointToSegment(point, wall.start, wall.end) > tolerance_m) {
      return false;
    }
  }
  return true;
}

void RankInterpretations(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                         const InterpretationTreeOptions& options, std::vector<Interpretation>* solutions) {
  std::vector<ScanSegment> uncertain = segments;
  for (ScanSegment& segment : uncertain) {
    segment.sigma_angle_rad = std::hypot(segment.sigma_angle_rad, RadFromDeg(options.sigma_wall_deg));
    segment.sigma_offset_m = std::hypot(segment.sigma_offset_m, options.sigma_wall_m);
  }
  for (Interpretation& solution : *solutions) {
    FitPose(plan, uncertain, &solution);
    solution.hidden_length_m = HiddenLength(plan, segments, solution.pose, 2 * options.position_tolerance_m);
  }
  std::stable_sort(solutions->begin(), solutions->end(),
                   [](const Interpretation& a, const Interpretation& b) {
                     const double length_a = a.matched_length_m - a.hidden_length_m;
                     const double length_b = b.matched_length_m - b.hidden_length_m;
                     if (std::abs(length_a - length_b) > 1e-6) return length_a > length_b;
                     return a.rms_m < b.rms_m;
                   });
}

}  // namespace cairn
