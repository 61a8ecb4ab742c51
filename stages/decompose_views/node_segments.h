#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/error.h"
#include "core/floor_plan.h"
#include "core/progress.h"

namespace cairn {

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
  std::vector<NodedEdge> edges;     // ascending by (start, end, tag); one for every segment that lies there
};

// Divides segments where they meet, with all vertices rounded to the grid: snap rounding, by GEOS, so that no
// two edges cross and the order in which edges lie around a vertex is that of the segments, up to edges that
// become one.  GEOS's C++ classes, not its C API: only they keep the tags.
// Errors: Cancelled, Failed (GEOS's own message).
Result<NodedSegments> NodeSegments(const std::vector<TaggedSegment>& segments, const Progress& progress);

}  // namespace cairn
