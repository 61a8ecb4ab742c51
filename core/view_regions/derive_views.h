#pragma once

#include <cstdint>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/views.h"

namespace cairn {

// View boundaries are looked for between all pairs of ends of walls: more would take days.
inline constexpr int kMaxNumDividedWalls = 200'000;

struct DerivedViews {
  Views views;
  int64_t num_boundaries = 0;
  // Borders whose two label sets do not differ by the labels of the boundaries between them; 0 except
  // for rounding.
  int64_t num_disagreements = 0;
};

// The regions of a clean floor plan from all points of which a laser sees the same walls [Simsarian96 §2.2].
// Differs from it: walls may stand anywhere, are seen from both sides (a label is one side of one wall) and
// through several windows (view_boundaries.h); in a polygon that is the source's definition.  Regions are
// faces of the arrangement: with walls that stand free two faces can have one label set without all of the
// segments between their points having it.
//
// | paper                          | here                                                 |
// | point visibility scan (I)      | FindViewBoundaries: rays from every vertex           |
// | intersections (II)             | Arrange: snap rounding, tile by tile                 |
// | traversal of boundaries (III)  | LabelFaces: a walk over the regions' borders         |
// | faces (IV)                     | Arrange                                              |
//
// Pure: same plan, same result for any number of threads.  O(n^2 log n + I log I) for n walls whose
// boundaries cross I times; memory is proportional to I.  Plans that take more than `memory_mib` are refused:
// those far beyond it by a sample of their boundaries, others when all crossings are counted, before they are
// kept.  Work is done in small parts, each reported; cancelling takes effect within one.  Errors: Corrupt (no
// clean plan: CheckFloorPlan, a vertex outside of the box, a wall that does not lie where its pieces do),
// NoMemory, Unsupported (more than kMaxNumDividedWalls, or than 32 bits can number), Cancelled.
Result<DerivedViews> DeriveViews(const FloorPlan& plan, int num_threads, int64_t memory_mib,
                                 Progress& progress);

}  // namespace cairn
