#include "core/world/appearance_graph.h"

#include <algorithm>
#include <tuple>

namespace cairn {

AppearanceGraph::AppearanceGraph(int num_nodes, std::vector<AppearanceLink> links)
    : offsets_(static_cast<size_t>(num_nodes) + 1, 0) {
  std::sort(links.begin(), links.end(), [](const AppearanceLink& a, const AppearanceLink& b) {
    return std::tie(a.node1, a.node2) < std::tie(b.node1, b.node2);
  });
  size_t num_distinct = 0;
  for (size_t i = 0; i < links.size(); ++i) {
    if (num_distinct > 0 && links[num_distinct - 1].node1 == links[i].node1 &&
        links[num_distinct - 1].node2 == links[i].node2) {
      links[num_distinct - 1].num_inliers += links[i].num_inliers;
    } else {
      links[num_distinct++] = links[i];
    }
  }
  links.resize(num_distinct);
  for (const AppearanceLink& link : links) {
    ++offsets_[link.node1 + 1];
    ++offsets_[link.node2 + 1];
  }
  for (int node = 0; node < num_nodes; ++node) offsets_[node + 1] += offsets_[node];
  neighbours_.resize(2 * links.size());
  std::vector<int64_t> next(offsets_.begin(), offsets_.end() - 1);
  // In two passes, smaller neighbours first, each list comes out ascending.
  for (const AppearanceLink& link : links) {
    neighbours_[next[link.node2]++] = {link.node1, link.num_inliers};
  }
  for (const AppearanceLink& link : links) {
    neighbours_[next[link.node1]++] = {link.node2, link.num_inliers};
  }
}

bool AppearanceGraph::AreLinked(NodeIdx node1, NodeIdx node2) const {
  const std::span<const Neighbour> neighbours = Neighbours(node1);
  const auto found = std::lower_bound(neighbours.begin(), neighbours.end(), node2,
                                      [](const Neighbour& n, NodeIdx node) { return n.node < node; });
  return found != neighbours.end() && found->node == node2;
}

std::vector<AppearanceLink> AppearanceGraph::Links() const {
  std::vector<AppearanceLink> links;
  links.reserve(num_links());
  for (NodeIdx node = 0; node < num_nodes(); ++node) {
    for (const Neighbour& neighbour : Neighbours(node)) {
      if (neighbour.node > node) links.push_back({node, neighbour.node, neighbour.num_inliers});
    }
  }
  return links;
}

AppearanceComponents FindComponents(const AppearanceGraph& graph) {
  AppearanceComponents components;
  components.component_of.assign(graph.num_nodes(), -1);
  for (NodeIdx start = 0; start < graph.num_nodes(); ++start) {
    if (components.component_of[start] >= 0) continue;
    const int component = static_cast<int>(components.nodes.size());
    std::vector<NodeIdx> nodes = {start};
    components.component_of[start] = component;
    for (size_t i = 0; i < nodes.size(); ++i) {
      for (const AppearanceGraph::Neighbour& neighbour : graph.Neighbours(nodes[i])) {
        if (components.component_of[neighbour.node] >= 0) continue;
        components.component_of[neighbour.node] = component;
        nodes.push_back(neighbour.node);
      }
    }
    std::sort(nodes.begin(), nodes.end());
    components.nodes.push_back(std::move(nodes));
  }
  return components;
}

AppearanceGraph InducedSubgraph(const AppearanceGraph& graph, const std::vector<NodeIdx>& nodes) {
  std::vector<NodeIdx> new_node(graph.num_nodes(), -1);
  for (size_t i = 0; i < nodes.size(); ++i) new_node[nodes[i]] = static_cast<NodeIdx>(i);
  std::vector<AppearanceLink> links;
  for (const NodeIdx node : nodes) {
    for (const AppearanceGraph::Neighbour& neighbour : graph.Neighbours(node)) {
      if (neighbour.node > node && new_node[neighbour.node] >= 0) {
        links.push_back({new_node[node], new_node[neighbour.node], neighbour.num_inliers});
      }
    }
  }
  return AppearanceGraph(static_cast<int>(nodes.size()), std::move(links));
}

AppearanceGraph WithoutLinksOf(const AppearanceGraph& graph, NodeIdx node) {
  std::vector<AppearanceLink> links = graph.Links();
  std::erase_if(links, [&](const AppearanceLink& link) { return link.node1 == node || link.node2 == node; });
  return AppearanceGraph(graph.num_nodes(), std::move(links));
}

std::vector<char> NodeMarks(int num_nodes, const std::vector<NodeIdx>& nodes) {
  std::vector<char> marks(num_nodes, 0);
  for (const NodeIdx node : nodes) marks[node] = 1;
  return marks;
}

std::vector<int> PathLengths(const AppearanceGraph& graph, NodeIdx start, const std::vector<char>& marked,
                             int max_links) {
  std::vector<int> lengths(graph.num_nodes(), -1);
  std::vector<NodeIdx> reached = {start};
  lengths[start] = 0;
  for (size_t i = 0; i < reached.size(); ++i) {
    const int length = lengths[reached[i]];
    if (length == max_links) break;
    for (const AppearanceGraph::Neighbour& neighbour : graph.Neighbours(reached[i])) {
      if (!marked[neighbour.node] || lengths[neighbour.node] >= 0) continue;
      lengths[neighbour.node] = length + 1;
      reached.push_back(neighbour.node);
    }
  }
  return lengths;
}

}  // namespace cairn
