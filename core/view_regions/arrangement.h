#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/floor_plan.h"
#include "core/view_regions/node_segments.h"
#include "core/view_regions/view_boundaries.h"

namespace cairn {

// The planar graph of walls and view boundaries, and its faces [Simsarian96 §2.2 step II, §2.2 step IV].
struct Arrangement {
  // A line between two vertices, start < end.
  struct Edge {
    int32_t start = 0, end = 0;
    bool is_wall = false;
    // The face on the left and on the right of start -> end, -1: outside of the domain.
    int32_t left = -1, right = -1;
    // View boundaries on it: crossings[first_crossing .. the next edge's).
    int64_t first_crossing = 0;
  };
  struct Crossing {
    int32_t boundary = 0;
    bool reversed = false;  // the boundary runs end -> start
  };

  std::vector<GridPoint> vertices;
  std::vector<Edge> edges;  // ascending by (start, end)
  std::vector<Crossing> crossings;
  // Faces of the domain: counter-clockwise corners.
  std::vector<int64_t> face_offsets{0};
  std::vector<int32_t> face_vertices;

  int32_t num_faces() const { return static_cast<int32_t>(face_offsets.size()) - 1; }
  int64_t CrossingsEnd(size_t edge) const {
    return edge + 1 < edges.size() ? edges[edge + 1].first_crossing : static_cast<int64_t>(crossings.size());
  }
};

// The lines of the planar graph.  Tags: boundaries from 0, pieces of walls from -1 down, then the
// box's sides.
std::vector<TaggedSegment> ArrangedSegments(const FloorPlan& plan,
                                            const std::vector<ViewBoundary>& boundaries);

// Nodes the lines on the plan's grid and walks around the faces, always turning left as sharply as possible.
// `noder`: of ArrangedSegments.  O((B + I) log(B + I)) for B boundaries with I intersections.  Errors:
// Cancelled, Unsupported.
Result<Arrangement> Arrange(const FloorPlan& plan, const SegmentNoder& noder, int num_threads,
                            Progress& progress);

}  // namespace cairn
