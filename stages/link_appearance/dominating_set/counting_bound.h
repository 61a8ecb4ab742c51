#pragma once

#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// Lower bounds on the size of a connected dominating set of a connected graph that are cheap to compute;
// returns the larger one:
// - every node is to be dominated, and one of d neighbours dominates d + 1: sum over all nodes of
//   1 / (1 + the most neighbours of a node that dominates it), a solution of the dual of the domination
//   program;
// - the set joins the neighbourhoods of any two nodes: the links of a longest shortest path, less one (a
//   double sweep finds a long one).
// O(links).
int CountingBound(const AppearanceGraph& component);

}  // namespace cairn::link_appearance
