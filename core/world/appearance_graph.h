#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/ids.h"

namespace cairn {

// Two nodes between which the local space can be reconstructed [Booij06 §III: S_ij = 1], node1 < node2.
struct AppearanceLink {
  NodeIdx node1 = 0;
  NodeIdx node2 = 0;
  int32_t num_inliers = 0;  // verified matches, > 0
  friend bool operator==(const AppearanceLink&, const AppearanceLink&) = default;
};

// The appearance graph G = (V, S) [Booij06 §III], fixed once made; undirected, without loops.
// 16 bytes a link and 8 a node.
class AppearanceGraph {
 public:
  struct Neighbour {
    NodeIdx node;
    int32_t num_inliers;
    friend bool operator==(const Neighbour&, const Neighbour&) = default;
  };

  AppearanceGraph() : AppearanceGraph(0, {}) {}
  // Links in any order; of several between two nodes the inliers add up.
  // REQUIRES: 0 <= node1 < node2 < num_nodes, num_inliers > 0
  AppearanceGraph(int num_nodes, std::vector<AppearanceLink> links);

  int num_nodes() const { return static_cast<int>(offsets_.size()) - 1; }
  int64_t num_links() const { return static_cast<int64_t>(neighbours_.size()) / 2; }
  // Ascending by node.
  std::span<const Neighbour> Neighbours(NodeIdx node) const {
    return {neighbours_.data() + offsets_[node], neighbours_.data() + offsets_[node + 1]};
  }
  int NumNeighbours(NodeIdx node) const { return static_cast<int>(offsets_[node + 1] - offsets_[node]); }
  bool AreLinked(NodeIdx node1, NodeIdx node2) const;
  std::vector<AppearanceLink> Links() const;  // ascending (node1, node2)

 private:
  std::vector<int64_t> offsets_;  // num_nodes + 1
  std::vector<Neighbour> neighbours_;
};

// The connected components, numbered by their smallest nodes.
struct AppearanceComponents {
  std::vector<int> component_of;            // per node
  std::vector<std::vector<NodeIdx>> nodes;  // per component, ascending
};
AppearanceComponents FindComponents(const AppearanceGraph& graph);

// The subgraph on some nodes, ascending: node i of it is nodes[i].
AppearanceGraph InducedSubgraph(const AppearanceGraph& graph, const std::vector<NodeIdx>& nodes);

// The graph without the links of one node, which stays as an isolated one: node numbers do not change.
AppearanceGraph WithoutLinksOf(const AppearanceGraph& graph, NodeIdx node);

// Marks per node of a list of nodes.
std::vector<char> NodeMarks(int num_nodes, const std::vector<NodeIdx>& nodes);

// Numbers of links on the shortest paths from `start` over marked nodes (`start` counts as marked); -1: none
// of at most `max_links`.  O(links of the nodes reached), beside num_nodes.
std::vector<int> PathLengths(const AppearanceGraph& graph, NodeIdx start, const std::vector<char>& marked,
                             int max_links);

}  // namespace cairn
