#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/floor_plan.h"
#include "runtime/scan_segments.h"

namespace cairn {

// What one pairing of a segment with a label says about the pose [Simsarian96 §2.3]: its heading, radians,
// and a line of places, metres, as the segment may be any portion of the wall.
struct Pairing {
  bool possible = false;
  double heading = 0;
  Eigen::Vector2d from = Eigen::Vector2d::Zero(),
                  to = Eigen::Vector2d::Zero();  // places of the robot: a line
};
Pairing MakePairing(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                    double length_tolerance_m);

// Distances, metres: of a point from the line between two others, of the places of two pairings.
double PointToLine(const Eigen::Vector2d& point, const Eigen::Vector2d& from, const Eigen::Vector2d& to);
double LineToLine(const Pairing& a, const Pairing& b);
// Whether a pairing's line of places comes within `reach` of a box.
bool Touches(const Eigen::AlignedBox2f& box, const Pairing& pairing, double reach);

}  // namespace cairn
