#include "stages/link_appearance/dominating_set/online_dominating_set.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

namespace cairn::link_appearance {
namespace {

// Number of kept nodes that are searched to find out whether the neighbours of one stay connected without it.
constexpr size_t kMaxDetourNodes = 2000;

}  // namespace

NodeIdx OnlineDominatingSet::FindComponent(NodeIdx node) {
  while (parent_[node] != node) {
    parent_[node] = parent_[parent_[node]];
    node = parent_[node];
  }
  return node;
}

// [Booij06 §VI: asks for it] "the image dataset is composed incrementally by an exploring robot"
OnlineDominatingSet::Change OnlineDominatingSet::Add(const std::vector<Neighbour>& links) {
  const NodeIdx node = num_nodes();
  neighbours_.push_back(links);
  kept_.push_back(0);
  parent_.push_back(node);
  std::map<NodeIdx, std::vector<Neighbour>> links_of;  // per component that is joined
  for (const Neighbour& link : links) {
    neighbours_[link.node].push_back({node, link.num_inliers});
    links_of[FindComponent(link.node)].push_back(link);
  }
  Change change;
  if (links_of.size() != 1) {
    kept_[node] = 1;
    change.kept.push_back(node);
  }
  for (const auto& [component, joined] : links_of) {
    parent_[component] = node;
    if (std::any_of(joined.begin(), joined.end(), [&](const Neighbour& n) { return kept_[n.node] != 0; })) {
      continue;
    }
    const auto key = [&](const Neighbour& n) {
      return std::tuple(neighbours_[n.node].size(), n.num_inliers, -n.node);
    };
    const Neighbour best =
        *std::max_element(joined.begin(), joined.end(),
                          [&](const Neighbour& a, const Neighbour& b) { return key(a) < key(b); });
    kept_[best.node] = 1;
    change.kept.push_back(best.node);
  }
  std::sort(change.kept.begin(), change.kept.end());
  change.dropped = DropAround(change.kept);
  return change;
}

std::vector<NodeIdx> OnlineDominatingSet::DropAround(const std::vector<NodeIdx>& added) {
  std::vector<NodeIdx> dropped;
  std::set<NodeIdx> candidates;
  for (const NodeIdx node : added) {
    for (const Neighbour& n : neighbours_[node]) {
      if (kept_[n.node] && !std::binary_search(added.begin(), added.end(), n.node)) candidates.insert(n.node);
    }
  }
  for (const NodeIdx node : candidates) {
    if (static_cast<int>(dropped.size()) >= max_num_dropped_) break;
    if (!IsSuperfluous(node)) continue;
    kept_[node] = 0;
    dropped.push_back(node);
  }
  return dropped;
}

bool OnlineDominatingSet::HasKeptNeighbour(NodeIdx node, NodeIdx beside) const {
  return std::any_of(neighbours_[node].begin(), neighbours_[node].end(),
                     [&](const Neighbour& n) { return kept_[n.node] && n.node != beside; });
}

bool OnlineDominatingSet::IsSuperfluous(NodeIdx node) {
  std::vector<NodeIdx> kept_around;
  for (const Neighbour& n : neighbours_[node]) {
    if (kept_[n.node]) {
      kept_around.push_back(n.node);
    } else if (!HasKeptNeighbour(n.node, node)) {
      return false;
    }
  }
  if (kept_around.empty()) return false;
  // A detour around the node joins its kept neighbours.
  std::set<NodeIdx> reached = {kept_around[0], node};
  std::vector<NodeIdx> queue = {kept_around[0]};
  for (size_t i = 0; i < queue.size() && i < kMaxDetourNodes; ++i) {
    for (const Neighbour& n : neighbours_[queue[i]]) {
      if (kept_[n.node] && reached.insert(n.node).second) queue.push_back(n.node);
    }
  }
  return std::all_of(kept_around.begin(), kept_around.end(),
                     [&](NodeIdx around) { return reached.count(around) > 0; });
}

std::vector<NodeIdx> OnlineDominatingSet::kept() const {
  std::vector<NodeIdx> nodes;
  for (NodeIdx node = 0; node < num_nodes(); ++node) {
    if (kept_[node]) nodes.push_back(node);
  }
  return nodes;
}

}  // namespace cairn::link_appearance
