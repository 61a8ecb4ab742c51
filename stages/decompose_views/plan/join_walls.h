#pragma once

#include <utility>
#include <vector>

#include "core/plan/floor_plan.h"

namespace cairn::decompose_views {

struct JoinedWalls {
  std::vector<PlanPiece> pieces;  // of one direction within a wall
  // Per wall the lowest of those that it was made of; ascending.  One of them may be that of several walls,
  // on different lines.
  std::vector<int32_t> origins;
  // Vertices that no piece uses any more, and the wall that they were on.
  std::vector<std::pair<int32_t, int32_t>> removed_vertices;
};

// Gives pieces that continue each other one wall, numbered anew, and removes vertices between two
// pieces of one wall where nothing else ends.  Pieces continue each other as long as no vertex of the wall
// lies farther than `tolerance` (grid units) from the line between its ends, and at each vertex the walls run
// straight on.  `directed`: pieces keep their direction, only those of one direction continue each other.
JoinedWalls JoinWalls(const std::vector<GridPoint>& vertices, const std::vector<PlanPiece>& pieces,
                      double tolerance, bool directed);

}  // namespace cairn::decompose_views
