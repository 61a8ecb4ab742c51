#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/floor_plan.h"
#include "core/view_regions/segment_tiles.h"

namespace cairn {

// A segment in grid coordinates (real-valued) with a tag of the caller's choice.
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
// cross, and the order in which edges lie around a vertex is that of the segments, up to edges that
// become one.
//
// A pixel's vertex depends on nothing outside of it, so tiles are processed one by one and fit without seams:
// progress is reported by tile, and cancelling takes effect within one.  (GEOS's noder, with which the tests
// compare, does all at once: it takes ten times the memory and cannot report progress.)
class SegmentNoder {
 public:
  // Keeps no reference.  O(n log n) for n short segments.
  explicit SegmentNoder(const std::vector<TaggedSegment>& segments);

  // How many pairs of segments cross: each adds at most a vertex and two edges to the graph.  Takes almost no
  // memory.  Errors: Cancelled.
  Result<int64_t> CountCrossings(int num_threads, Progress& progress) const;

  // O((n + I) log(n + I)) for I crossings.  Deterministic for any number of threads.
  // Errors: Cancelled, Unsupported (more vertices than 32 bits number).
  Result<NodedSegments> Node(int num_threads, Progress& progress) const;

 private:
  std::vector<SubSegment> segments_;
  std::vector<int32_t> tags_;
  SegmentTiles tiles_;
};

}  // namespace cairn
