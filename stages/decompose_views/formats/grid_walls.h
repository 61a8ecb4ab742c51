#pragma once

#include <vector>

#include "core/base/error.h"
#include "stages/decompose_views/formats/input_plan.h"
#include "stages/decompose_views/formats/occupancy_grid.h"

namespace cairn::decompose_views {

struct GridWallsOptions {
  // Occupied cells that touch each other and extend no farther than this are left out, and so are gaps as
  // small within walls.  REQUIRES: in [0, 100]
  double min_blob_m = 0.15;
  // Walls up to this thick become one line in their middle, thicker ones their outline.  REQUIRES: in [0, 10]
  double thin_wall_m = 0.1;
  // How far a wall's cells may lie beside its line, in cells.  REQUIRES: in [0.5, 10]
  double trace_tolerance_cells = 1;
};

// The walls of an occupancy grid as a laser meets them, in the map's frame, metres: lines through the middles
// of thin walls, and the faces of thick ones, where a free cell is beside them; unknown cells are no walls.
// Lines of cells are divided where they bend (Douglas and Peucker, 1973), each part is fitted to all of its
// cells by least squares, and parts meet where their lines do.  Deterministic.  O(cells). Errors: NoData (no
// occupied cell is left, or none beside a free one: says how many of each kind there are).
Result<std::vector<InputSegment>> TraceGridWalls(const OccupancyGrid& grid, const GridWallsOptions& options);

}  // namespace cairn::decompose_views
