#include "stages/link_appearance/dominating_set/domination.h"

#include <algorithm>

namespace cairn::link_appearance {

Domination::Domination(const AppearanceGraph& graph, const DominationOptions& options)
    : graph_(&graph), options_(options), components_(FindComponents(graph)), demands_(graph.num_nodes(), 0) {
  // [Booij06 §VI: asks for it] weights of links and a parameter for the robustness of the set
  const int64_t wanted = int64_t{options.num_dominators} * options.strong_num_inliers;
  for (const std::vector<NodeIdx>& nodes : components_.nodes) {
    if (static_cast<int>(nodes.size()) < options.min_component_nodes) continue;
    for (const NodeIdx node : nodes) {
      int64_t most = 0;
      for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
        most += Weight(n.num_inliers);
        if (most >= wanted) break;
      }
      demands_[node] = std::max<int64_t>(1, std::min(wanted, most));
    }
  }
}

int64_t Domination::Shortfall(NodeIdx node, const std::vector<char>& kept) const {
  // [Booij06 eq. 1] u in V' or there is a v in V' with (u, v) in S; here m of them, by weight
  if (kept[node]) return 0;
  int64_t missing = demands_[node];
  for (const AppearanceGraph::Neighbour& n : graph_->Neighbours(node)) {
    if (missing <= 0) break;
    if (kept[n.node]) missing -= Weight(n.num_inliers);
  }
  return std::max<int64_t>(0, missing);
}

std::vector<NodeIdx> Domination::Undominated(const std::vector<char>& kept) const {
  std::vector<NodeIdx> nodes;
  for (NodeIdx node = 0; node < graph_->num_nodes(); ++node) {
    if (Shortfall(node, kept) > 0) nodes.push_back(node);
  }
  return nodes;
}

// [Booij06 §IV-A] "the subgraph G' is connected": in each component
bool Domination::IsConnected(const std::vector<char>& kept) const {
  std::vector<char> reached(kept.size(), 0);
  std::vector<NodeIdx> stack;
  for (const std::vector<NodeIdx>& nodes : components_.nodes) {
    bool started = false;
    for (const NodeIdx start : nodes) {
      if (!kept[start] || reached[start]) continue;
      if (started) return false;
      started = true;
      reached[start] = 1;
      stack = {start};
      while (!stack.empty()) {
        const NodeIdx node = stack.back();
        stack.pop_back();
        for (const AppearanceGraph::Neighbour& n : graph_->Neighbours(node)) {
          if (!kept[n.node] || reached[n.node]) continue;
          reached[n.node] = 1;
          stack.push_back(n.node);
        }
      }
    }
  }
  return true;
}

}  // namespace cairn::link_appearance
