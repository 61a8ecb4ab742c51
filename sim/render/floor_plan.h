#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "sim/render/layout.h"

namespace cairn::sim {

// A closed ring of corners, the last joined to the first.
using Ring = std::vector<std::array<double, 2>>;
// An outer ring, counter-clockwise, and its holes, clockwise.
struct PlanPolygon {
  Ring outer;
  std::vector<Ring> holes;
};

// The part of `bounds` that no obstacle covers, exactly: its corners are corners of the rectangles or
// crossings of their edges.  One polygon per connected part, by its lowest, then leftmost corner.
std::vector<PlanPolygon> FreeSpace(const Rect& bounds, const std::vector<Rect>& obstacles);

// The floor plan as a GeoJSON FeatureCollection, metres in the capture's world frame.  Property "kind" of
// a feature:
//   free_space           where the floor is free; always the first feature.  A Polygon, or a MultiPolygon
//                        where the free floor has several parts
//   wall                 a straight wall with its openings, a MultiPolygon of its pieces
//   furniture, pillar    with "height_m"
//   room, corridor       with "name"
Status WriteFloorPlan(const Layout& layout, const std::vector<Rect>& obstacles, const std::string& path);

}  // namespace cairn::sim
