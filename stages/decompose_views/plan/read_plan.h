#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"

namespace cairn::decompose_views {

// A wall of a file.
struct InputSegment {
  Eigen::Vector2d start, end;  // metres
  int line = 0;                // of the file; GeoJSON: the ring's number, from 1
};

// The floor plan of a file, not cleaned yet.
struct InputPlan {
  // Polygons: their rings, closed (the first point is not repeated), the interior to the left.
  std::vector<std::vector<Eigen::Vector2d>> rings;
  // Otherwise segments in any order, which may cross, overlap or leave gaps.
  std::vector<InputSegment> segments;

  bool closed() const { return !rings.empty(); }
};

// Reads a floor plan in metres: GeoJSON (RFC 7946's objects, coordinates taken as plane metres: Polygon,
// MultiPolygon, GeometryCollection, Feature, FeatureCollection; where features have the property "kind" =
// "free_space", those alone) where the text begins with '{', else lines `x0,y0,x1,y1`, blank lines and lines
// that begin with '#' left out.
// Errors: NotFound, Corrupt (no JSON, not four finite numbers in a line, an open ring, fewer than three
// points; names the line or ring), Unsupported (other geometries), NoData (no walls).
Result<InputPlan> ReadPlan(const std::string& path);
// `what` names the text in messages.
Result<InputPlan> ParsePlan(const std::string& text, const std::string& what);

}  // namespace cairn::decompose_views
