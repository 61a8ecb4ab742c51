#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"

namespace cairn {

// Segments by the tiles of the plane that they pass, so that each tile can be processed alone.
//
// Coordinates are multiples of 2^-kSubBits grid units, as fine as doubles are at the grid's far end; with
// them orientations are exact in 128 bits.
inline constexpr int kSubBits = 24;
struct SubSegment {
  int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};
// `start`, `end`: real-valued grid coordinates, below kMaxGridCoordinate and the domain's margin.
SubSegment MakeSubSegment(const Eigen::Vector2d& start, const Eigen::Vector2d& end);

// Pixel (i, j) is the square of one grid unit around the grid point (i, j), its lower and left sides
// included: each point of the plane lies in one.
GridPoint PixelOf(int64_t sub_x, int64_t sub_y);
// Whether a segment passes a pixel.  Exact.
bool Passes(const SubSegment& segment, const GridPoint& pixel);

// Whether two segments cross, both at their inside.  Exact.  If they do, gives every pixel that the crossing
// may lie in, given the accuracy of the computation: one pixel, except for about one crossing in a
// hundred thousand.
bool CrossAt(const SubSegment& a, const SubSegment& b, GridPoint* low, GridPoint* high);

// A rectangle of pixels, x in [low.x, high.x), y in [low.y, high.y), and the segments that may pass one of
// them: segments[first .. last) of SegmentTiles.
struct Tile {
  GridPoint low, high;
  int64_t first = 0, last = 0;
};

// Tiles that cover all segments and are disjoint.  A tile is halved while its halves have fewer segments to
// compare: many segments that meet in one vertex stay together.
struct SegmentTiles {
  std::vector<Tile> tiles;
  std::vector<int32_t> segments;
};
SegmentTiles MakeTiles(const std::vector<SubSegment>& segments);

}  // namespace cairn
