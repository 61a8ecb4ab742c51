#include "stages/link_appearance/dominating_set/restore_cycles.h"

#include <algorithm>

namespace cairn::link_appearance {
namespace {

class Restorer {
 public:
  Restorer(const AppearanceGraph& graph, const std::vector<NodeIdx>& kept, int c)
      : graph_(graph), c_(c), kept_(NodeMarks(graph.num_nodes(), kept)), reached_by_(graph.num_nodes(), -1) {}

  std::vector<NodeIdx> Run() {
    std::vector<NodeIdx> added;
    for (bool changed = true; changed;) {
      changed = false;
      for (NodeIdx i = 0; i < graph_.num_nodes(); ++i) {
        if (kept_[i]) continue;
        const NodeIdx j = FindFarNeighbour(i);
        if (j < 0) continue;
        // [Booij06 §IV-C] i and j join the set, and the pairs are examined again with it
        for (const NodeIdx node : {i, j}) {
          if (!kept_[node]) added.push_back(node);
          kept_[node] = 1;
        }
        changed = true;
      }
    }
    std::sort(added.begin(), added.end());
    return added;
  }

 private:
  // The smallest j >= i, linked to i or i itself, with a kept neighbour too far from one of i's; -1: none.
  NodeIdx FindFarNeighbour(NodeIdx i) {
    NodeIdx first = -1;
    for (const AppearanceGraph::Neighbour& a : graph_.Neighbours(i)) {
      if (!kept_[a.node]) continue;
      Reach(a.node);
      // [Booij06 §IV-C] a neighbour of i and one of j with no path over the set of fewer than c links
      if (HasUnreached(i)) return i;
      for (const AppearanceGraph::Neighbour& j : graph_.Neighbours(i)) {
        if (j.node < i || kept_[j.node] || (first >= 0 && j.node >= first)) continue;
        if (HasUnreached(j.node)) first = j.node;
      }
    }
    return first;
  }

  bool HasUnreached(NodeIdx node) const {
    const auto neighbours = graph_.Neighbours(node);
    return std::any_of(neighbours.begin(), neighbours.end(), [&](const AppearanceGraph::Neighbour& b) {
      return kept_[b.node] && reached_by_[b.node] != run_;
    });
  }

  // Marks the kept nodes within fewer than c links of `start`.
  void Reach(NodeIdx start) {
    ++run_;
    reached_by_[start] = run_;
    ring_ = {start};
    for (int length = 1; length < c_ && !ring_.empty(); ++length) {
      next_ring_.clear();
      for (const NodeIdx node : ring_) {
        for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
          if (!kept_[n.node] || reached_by_[n.node] == run_) continue;
          reached_by_[n.node] = run_;
          next_ring_.push_back(n.node);
        }
      }
      std::swap(ring_, next_ring_);
    }
  }

  const AppearanceGraph& graph_;
  const int c_;
  std::vector<char> kept_;
  std::vector<int64_t> reached_by_;  // number of the last run that reached a node
  int64_t run_ = 0;
  std::vector<NodeIdx> ring_, next_ring_;
};

}  // namespace

std::vector<NodeIdx> RestoreCycles(const AppearanceGraph& graph, const std::vector<NodeIdx>& kept, int c) {
  return Restorer(graph, kept, c).Run();
}

}  // namespace cairn::link_appearance
