#pragma once

#include <vector>

#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// A connected dominating set that is kept up while nodes arrive one by one [Booij06 §VI: asks for it].
//
// After each arrival the kept nodes of each component are connected and dominate it.  An arrival that joins p
// components (p = 0: it starts one) keeps at most p + 1 nodes more: none where p = 1 and a neighbour is kept;
// one neighbour where p = 1 and none is; otherwise itself, and in each component where none of its neighbours
// is kept, one of these.  Of such neighbours the one with the most links, then inliers, then the smallest
// number.  It drops at most max_num_dropped nodes that the new ones made superfluous.
class OnlineDominatingSet {
 public:
  using Neighbour = AppearanceGraph::Neighbour;
  struct Change {
    std::vector<NodeIdx> kept;     // ascending
    std::vector<NodeIdx> dropped;  // ascending
  };

  explicit OnlineDominatingSet(int max_num_dropped) : max_num_dropped_(max_num_dropped) {}

  // The next node, num_nodes() before the call, with its links to earlier ones, ascending.  O(links around
  // the nodes that change), besides joining components.
  Change Add(const std::vector<Neighbour>& links);

  int num_nodes() const { return static_cast<int>(neighbours_.size()); }
  bool IsKept(NodeIdx node) const { return kept_[node]; }
  std::vector<NodeIdx> kept() const;  // ascending

 private:
  NodeIdx FindComponent(NodeIdx node);
  bool HasKeptNeighbour(NodeIdx node, NodeIdx beside) const;
  bool IsSuperfluous(NodeIdx node);
  std::vector<NodeIdx> DropAround(const std::vector<NodeIdx>& added);

  int max_num_dropped_;
  std::vector<std::vector<Neighbour>> neighbours_;
  std::vector<char> kept_;
  std::vector<NodeIdx> parent_;  // of a forest whose roots stand for components
};

}  // namespace cairn::link_appearance
