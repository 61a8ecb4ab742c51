#pragma once

#include <vector>

#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// The columns of the program of connected dominating sets (connected_bound.h): nodes x_v, arcs y_uv of both
// directions of each link, and root arcs z_v of the nodes that the tree may start from.
struct TreeColumns {
  struct Arc {
    NodeIdx from;  // -1: a root arc
    NodeIdx to;
  };
  explicit TreeColumns(const AppearanceGraph& graph);

  int num_nodes = 0;
  // Arcs 2 e and 2 e + 1 are those of link e, then root arcs; arc a is column num_nodes + a.
  std::vector<Arc> arcs;
  int num_link_arcs = 0;
  // The node with the fewest neighbours: the tree starts at it or one of its neighbours.
  NodeIdx root_node = 0;
  int size() const { return num_nodes + static_cast<int>(arcs.size()); }
};

// A violated inequality: the arcs that enter S are at least 1 (reached < 0), or x of the node `reached`.
struct TreeCut {
  std::vector<NodeIdx> nodes;  // S, ascending
  NodeIdx reached = -1;
  double violation = 0;
};

// Finds the sets S that too few arcs of a point of the program enter: those that contain a node and all its
// neighbours, which the tree must reach, by minimum cuts from the root; several per node, with the arcs of
// earlier ones treated as saturated ("nested cuts" [Koch & Martin 1998]).  Where there are none, sets that
// contain a node which is reached by less than its x.  `columns` in the order of TreeColumns.
std::vector<TreeCut> FindTreeCuts(const AppearanceGraph& graph, const TreeColumns& columns,
                                  const double* values, double tolerance);

}  // namespace cairn::link_appearance
