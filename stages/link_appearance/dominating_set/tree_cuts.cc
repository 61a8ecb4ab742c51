#include "stages/link_appearance/dominating_set/tree_cuts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "stages/link_appearance/dominating_set/minimum_cut.h"

namespace cairn::link_appearance {
namespace {

// Capacities are integers, so that cuts do not depend on the order of sums.
constexpr double kUnitsPerOne = 1e8;
// Added to every arc, so that of equal cuts one of few arcs is found.
constexpr int64_t kCreep = 1000;
constexpr int64_t kUnlimited = int64_t{1} << 50;
constexpr int kMaxNestedCuts = 8;

int64_t Units(double value) { return std::llround(std::max(0.0, value) * kUnitsPerOne); }

class TreeNetwork {
 public:
  TreeNetwork(const TreeColumns& columns, const double* values)
      : columns_(columns), values_(values), network_(columns.num_nodes + 2) {
    const double* arc_values = values + columns.num_nodes;
    for (int a = 0; a < columns.num_link_arcs; a += 2) {
      network_.AddEdge(columns.arcs[a].from, columns.arcs[a].to, Units(arc_values[a]) + kCreep,
                       Units(arc_values[a + 1]) + kCreep);
    }
    for (size_t a = columns.num_link_arcs; a < columns.arcs.size(); ++a) {
      root_edges_.push_back(network_.AddEdge(Root(), columns.arcs[a].to, Units(arc_values[a]) + kCreep, 0));
    }
    for (NodeIdx node = 0; node < columns.num_nodes; ++node) {
      to_sink_.push_back(network_.AddEdge(node, Sink(), 0, 0));
    }
  }

  // Sets that contain `targets` and are entered by less than `wanted`.
  std::vector<TreeCut> Separate(const std::vector<NodeIdx>& targets, double wanted, NodeIdx reached,
                                double tolerance) {
    std::vector<TreeCut> cuts;
    std::vector<std::pair<int, int64_t>> changed;
    for (const NodeIdx node : targets) network_.SetCapacity(to_sink_[node], kUnlimited);
    while (static_cast<int>(cuts.size()) < kMaxNestedCuts) {
      const CutNetwork::Cut least = network_.LeastCut(Root(), Sink(), Units(wanted - tolerance));
      if (least.is_sink_side.empty()) break;
      TreeCut cut{.reached = reached, .violation = wanted};
      for (NodeIdx node = 0; node < columns_.num_nodes; ++node) {
        if (least.is_sink_side[node]) cut.nodes.push_back(node);
      }
      for (size_t a = 0; a < columns_.arcs.size(); ++a) {
        const auto [from, to] = columns_.arcs[a];
        if (!least.is_sink_side[to] || (from >= 0 && least.is_sink_side[from])) continue;
        cut.violation -= values_[columns_.num_nodes + a];
        const int edge = EdgeOf(a);
        changed.emplace_back(edge, network_.Capacity(edge));
        network_.SetCapacity(edge, Units(1));
      }
      if (cut.violation < tolerance) break;
      cuts.push_back(std::move(cut));
    }
    for (auto it = changed.rbegin(); it != changed.rend(); ++it) network_.SetCapacity(it->first, it->second);
    for (const NodeIdx node : targets) network_.SetCapacity(to_sink_[node], 0);
    return cuts;
  }

 private:
  int Root() const { return columns_.num_nodes; }
  int Sink() const { return columns_.num_nodes + 1; }
  // Link arcs were added in pairs, each as an edge and its reverse.
  int EdgeOf(size_t arc) const {
    return static_cast<int>(arc) < columns_.num_link_arcs ? static_cast<int>(arc)
                                                          : root_edges_[arc - columns_.num_link_arcs];
  }

  const TreeColumns& columns_;
  const double* values_;
  CutNetwork network_;
  std::vector<int> root_edges_, to_sink_;
};

}  // namespace

TreeColumns::TreeColumns(const AppearanceGraph& graph) : num_nodes(graph.num_nodes()) {
  for (NodeIdx node = 0; node < num_nodes; ++node) {
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
      if (n.node < node) continue;
      arcs.push_back({node, n.node});
      arcs.push_back({n.node, node});
    }
    if (graph.NumNeighbours(node) < graph.NumNeighbours(root_node)) root_node = node;
  }
  num_link_arcs = static_cast<int>(arcs.size());
  arcs.push_back({-1, root_node});
  for (const AppearanceGraph::Neighbour& n : graph.Neighbours(root_node)) arcs.push_back({-1, n.node});
}

std::vector<TreeCut> FindTreeCuts(const AppearanceGraph& graph, const TreeColumns& columns,
                                  const double* values, double tolerance) {
  std::vector<TreeCut> cuts;
  std::set<std::vector<NodeIdx>> found;
  TreeNetwork network(columns, values);
  const auto separate = [&](const std::vector<NodeIdx>& targets, double wanted, NodeIdx reached) {
    for (TreeCut& cut : network.Separate(targets, wanted, reached, tolerance)) {
      if (found.insert(cut.nodes).second) cuts.push_back(std::move(cut));
    }
  };
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    std::vector<NodeIdx> targets = {node};
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) targets.push_back(n.node);
    separate(targets, 1, -1);
  }
  if (!cuts.empty()) return cuts;
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    if (values[node] > 10 * tolerance) separate({node}, values[node], node);
  }
  return cuts;
}

}  // namespace cairn::link_appearance
