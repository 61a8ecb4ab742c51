#pragma once

#include <vector>

#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// Keeps paths over the kept nodes short [Booij06 §IV-C]: for nodes i, j that are not kept and were neighbours
// (i = j allowed), if some kept neighbour of i and some kept neighbour of j are not connected by a path over
// the kept nodes of fewer than c links, keeps i and j; this is repeated with the grown set, smallest (i, j)
// first.  The source leaves c's unit open: here it is links of the path over the kept nodes.
//
// Hence, where each node is kept or has a kept neighbour and c >= 2:
// - the way from i to a former neighbour j over kept nodes has at most c + 1 links;
// - a path of l links becomes one of at most (c - 1) l + 2: a ratio of at most c - 1 + 2 / l.
// Returns the nodes to add, ascending.  REQUIRES: c >= 2
std::vector<NodeIdx> RestoreCycles(const AppearanceGraph& graph, const std::vector<NodeIdx>& kept, int c);

}  // namespace cairn::link_appearance
