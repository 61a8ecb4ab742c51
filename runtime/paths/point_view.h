#pragma once

#include <vector>

#include <Eigen/Core>

namespace cairn {

// A straight thing in the way of looks from one point, and the directions in which it is.
struct BlockedArc {
  double from = 0, to = 0;     // radians in [-pi, pi], from <= to
  Eigen::Vector2d start, end;  // relative to the point, counter-clockwise around it

  // How far away it is in a direction; beyond its ends, its line.
  double Distance(double angle) const;
};

// Appends the arcs of a segment seen from the origin, two where it lies across the direction pi;
// `spare_start` and `spare_end` radians are left out at the ends that come first and last counter-clockwise.
// None for a segment on a line with the origin.
void AppendArcs(const Eigen::Vector2d& start, const Eigen::Vector2d& end, double spare_start,
                double spare_end, std::vector<BlockedArc>* arcs);

// The nearest of the arcs in each direction: disjoint, ascending.  Segments may cross.  O(n log n).
std::vector<BlockedArc> NearestArcs(std::vector<BlockedArc> arcs);

// The first arc of a view that ends at or after a direction.
std::vector<BlockedArc>::const_iterator FirstArcFrom(const std::vector<BlockedArc>& view, double angle);

// The direction of a vector, radians in [-pi, pi].
double AngleOf(const Eigen::Vector2d& direction);

}  // namespace cairn
