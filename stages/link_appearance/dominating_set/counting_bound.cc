#include "stages/link_appearance/dominating_set/counting_bound.h"

#include <algorithm>
#include <cmath>

namespace cairn::link_appearance {
namespace {

int DominationBound(const AppearanceGraph& graph) {
  double bound = 0;
  for (NodeIdx node = 0; node < graph.num_nodes(); ++node) {
    int most = graph.NumNeighbours(node);
    for (const AppearanceGraph::Neighbour& n : graph.Neighbours(node)) {
      most = std::max(most, graph.NumNeighbours(n.node));
    }
    bound += 1.0 / (1 + most);
  }
  return static_cast<int>(std::ceil(bound * (1 - 1e-9)));
}

int DistanceBound(const AppearanceGraph& graph) {
  const std::vector<char> all(graph.num_nodes(), 1);
  NodeIdx end = 0;
  int length = 0;
  for (int sweep = 0; sweep < 2; ++sweep) {
    const std::vector<int> lengths = PathLengths(graph, end, all, graph.num_nodes());
    const auto farthest = std::max_element(lengths.begin(), lengths.end());
    end = static_cast<NodeIdx>(farthest - lengths.begin());
    length = *farthest;
  }
  return length - 1;
}

}  // namespace

int CountingBound(const AppearanceGraph& component) {
  return std::max({component.num_nodes() > 0 ? 1 : 0, DominationBound(component), DistanceBound(component)});
}

}  // namespace cairn::link_appearance
