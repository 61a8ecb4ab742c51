#pragma once

#include <cstdint>
#include <vector>

#include "core/world/appearance_graph.h"

namespace cairn::link_appearance {

// The definition of an image that the kept ones locate.
//
// A link of N verified inliers counts min(N, strong_num_inliers) / strong_num_inliers: 1 for each link where
// strong_num_inliers is 1 [Booij06].  A node that is not kept is dominated when its links to kept nodes add
// up to `num_dominators`, or when all its neighbours are kept.  A kept node is dominated by itself.
struct DominationOptions {
  // m of m-fold domination [Booij06: 1].  REQUIRES: >= 1
  int num_dominators = 1;
  // A link with at least this many inliers counts fully; 1: all links count alike [Booij06].  REQUIRES: >= 1
  int strong_num_inliers = 1;
  // Smaller components are left out: none of their nodes is kept.  REQUIRES: >= 1
  int min_component_nodes = 1;
};

// The demands of a graph's nodes, in units of 1 / strong_num_inliers: integers, so that sums do not depend on
// their order.
class Domination {
 public:
  // `graph` outlives this object.
  Domination(const AppearanceGraph& graph, const DominationOptions& options);

  const AppearanceGraph& graph() const { return *graph_; }
  const DominationOptions& options() const { return options_; }
  const AppearanceComponents& components() const { return components_; }
  // The weight of a link for each of its nodes.
  int64_t Weight(int32_t num_inliers) const { return std::min(num_inliers, options_.strong_num_inliers); }
  // The sum that the links of a node to kept ones must reach; 0 in components that are left out.
  int64_t Demand(NodeIdx node) const { return demands_[node]; }
  // Whether the node's component takes part.
  bool IsIn(NodeIdx node) const { return demands_[node] > 0; }

  // What a node lacks to be dominated by the marked ones; 0 if it is dominated.
  int64_t Shortfall(NodeIdx node, const std::vector<char>& kept) const;
  // Nodes that the marked ones do not dominate, ascending.
  std::vector<NodeIdx> Undominated(const std::vector<char>& kept) const;
  // Whether the marked nodes of each component are connected by links among themselves.
  bool IsConnected(const std::vector<char>& kept) const;

 private:
  const AppearanceGraph* graph_;
  DominationOptions options_;
  AppearanceComponents components_;
  std::vector<int64_t> demands_;
};

}  // namespace cairn::link_appearance
