#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace cairn::decompose_views {

// Coordinates of a plan lie within this of its file's origin.
inline constexpr double kMaxCoordinateM = 1e9;

// A wall of a file.
struct InputSegment {
  Eigen::Vector2d start, end;  // metres
  int line = 0;  // of the file; GeoJSON: the number of its ring or line; grids: of the wall; from 1
};

// The floor plan of a file, not cleaned yet.
struct InputPlan {
  // Polygons: their rings, closed (the first point is not repeated), the interior to the left.
  std::vector<std::vector<Eigen::Vector2d>> rings;
  // Otherwise segments in any order, which may cross, overlap or leave gaps.
  std::vector<InputSegment> segments;
  // What its reader left out or chose, one sentence each: for the user.
  std::vector<std::string> notes;

  bool closed() const { return !rings.empty(); }
};

// Twice the area of a ring, m^2; negative if it is clockwise.
double TwiceArea(const std::vector<Eigen::Vector2d>& ring);

}  // namespace cairn::decompose_views
