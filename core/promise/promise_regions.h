#pragma once

#include <cstdint>
#include <vector>

#include "core/promise/promise_cover.h"
#include "core/promise/promise_nodes.h"

namespace cairn {

// Nodes that a robot with these landmarks alone, and no others, keeps the promises of.
struct PromiseRegion {
  std::vector<int32_t> nodes;   // ascending
  std::vector<size_t> classes;  // positions, ascending
};

struct PromiseRegions {
  std::vector<PromiseRegion> regions;  // every node is in one
  // No division of the nodes whose regions have so few landmarks has fewer: all regions' landmarks together
  // meet all demands.
  int lower_bound = 0;
};

// Divides the nodes into few regions of at most `max_landmarks` landmarks each (more only where a single node
// needs more), every one connected: begins at a node and adds the neighbour that lacks least of what the
// region has, while there is room.  What room is left is filled with the landmarks that its nodes expect
// most. `keep`: per class, whether it is a landmark; `of_class`, `demands`: as CoverProblem; `cover_bound`:
// LandmarkCover::lower_bound.  O(nodes^2 + sights * neighbours).
PromiseRegions DivideNodes(const std::vector<PromiseNode>& nodes, double view_radius, double view_radius_deg,
                           const CoverProblem& problem, const std::vector<char>& keep, size_t max_landmarks,
                           int64_t cover_bound);

}  // namespace cairn
