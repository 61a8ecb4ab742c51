#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/floor_plan.h"
#include "stages/decompose_views/plan/segment_tiles.h"

namespace cairn::decompose_views {

// A segment in grid coordinates (real-valued) with whatever its maker wants to find again.
struct TaggedSegment {
  Eigen::Vector2d start, end;
  int32_t tag = 0;
};

// A part of a tagged segment between two vertices, in the segment's direction.
struct NodedEdge {
  int32_t start = 0, end = 0;
  int32_t tag = 0;
};

struct NodedSegments {
  std::vector<GridPoint> vertices;  // ascending
  // Ascending by (lower end, higher end, tag, start); one for every segment that lies there.
  std::vector<NodedEdge> edges;
};

// Divides segments where they meet, with all vertices rounded to the grid, by snap rounding [Hobby99]: every
// pixel in which a segment ends or two cross becomes a vertex of all segments that pass it.  No two edges
// cross, and the order in which edges lie around a vertex is that of the segments, up to edges that become
// one.
//
// A pixel's vertex depends on nothing outside of it, so tiles are worked on one by one and fit without seams:
// progress goes by tiles, and cancelling ends within one.  (GEOS's noder, the tests' oracle, does all at
// once: ten times the memory, no end in sight until it ends.)
class SegmentNoder {
 public:
  // Keeps no reference.  O(n log n) for n short segments.
  explicit SegmentNoder(const std::vector<TaggedSegment>& segments);

  // How many pairs of segments cross: with each, the graph has a vertex and two edges more, at most.
  // Takes no memory to speak of.  Errors: Cancelled.
  Result<int64_t> CountCrossings(int num_threads, Progress& progress) const;

  // O((n + I) log(n + I)) for I crossings.  Deterministic for any number of threads.
  // Errors: Cancelled, Unsupported (more vertices than 32 bits number).
  Result<NodedSegments> Node(int num_threads, Progress& progress) const;

 private:
  std::vector<SubSegment> segments_;
  std::vector<int32_t> tags_;
  SegmentTiles tiles_;
};

}  // namespace cairn::decompose_views
