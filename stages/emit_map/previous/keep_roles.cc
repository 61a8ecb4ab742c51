#include "stages/emit_map/previous/keep_roles.h"

#include <algorithm>
#include <deque>

#include "stages/emit_map/previous/positions.h"

namespace cairn::emit_map {
namespace {

constexpr NodeIdx kNoNode = -1;

class RoleKeeper {
 public:
  RoleKeeper(const std::vector<char>& was_kept, const Appearance& appearance)
      : appearance_(appearance), graph_(appearance.graph), kept_(was_kept) {
    for (const AppearanceNode& node : appearance.nodes)
      is_wanted_.push_back(node.role != NodeRole::kDropped ? 1 : 0);
  }

  std::vector<char> Run() {
    for (const std::vector<NodeIdx>& component : FindComponents(graph_).nodes) {
      // Small components have no kept node.
      if (std::none_of(component.begin(), component.end(),
                       [&](NodeIdx node) { return is_wanted_[node] != 0; })) {
        for (const NodeIdx node : component) kept_[node] = 0;
        continue;
      }
      for (const NodeIdx node : component) Dominate(node);
      Connect(component);
    }
    return kept_;
  }

 private:
  int64_t Weight(int32_t num_inliers) const {
    return std::min<int64_t>(num_inliers, appearance_.strong_num_inliers);
  }

  // Better: wanted, then of more weight, then the smaller.
  void Dominate(NodeIdx node) {
    if (kept_[node] != 0) return;
    int64_t all = 0, given = 0;
    std::vector<AppearanceGraph::Neighbour> others;
    for (const AppearanceGraph::Neighbour& neighbour : graph_.Neighbours(node)) {
      all += Weight(neighbour.num_inliers);
      if (kept_[neighbour.node] != 0) {
        given += Weight(neighbour.num_inliers);
      } else {
        others.push_back(neighbour);
      }
    }
    const int64_t demand =
        std::min<int64_t>(all, int64_t{appearance_.num_dominators} * appearance_.strong_num_inliers);
    std::stable_sort(others.begin(), others.end(), [&](const auto& a, const auto& b) {
      if (is_wanted_[a.node] != is_wanted_[b.node]) return is_wanted_[a.node] > is_wanted_[b.node];
      return a.num_inliers > b.num_inliers;
    });
    if (others.empty() && all == 0) kept_[node] = is_wanted_[node];  // alone
    for (size_t i = 0; given < demand; ++i) {
      kept_[others[i].node] = 1;
      given += Weight(others[i].num_inliers);
    }
  }

  // Marks the kept nodes that are connected with this one by kept ones.
  void MarkPiece(NodeIdx start, std::vector<char>* marks) const {
    std::deque<NodeIdx> queue = {start};
    (*marks)[start] = 1;
    while (!queue.empty()) {
      const NodeIdx node = queue.front();
      queue.pop_front();
      for (const AppearanceGraph::Neighbour& neighbour : graph_.Neighbours(node)) {
        if (kept_[neighbour.node] == 0 || (*marks)[neighbour.node] != 0) continue;
        (*marks)[neighbour.node] = 1;
        queue.push_back(neighbour.node);
      }
    }
  }

  void Connect(const std::vector<NodeIdx>& component) {
    const auto first =
        std::find_if(component.begin(), component.end(), [&](NodeIdx node) { return kept_[node] != 0; });
    if (first == component.end()) return;
    std::vector<char> in_piece(kept_.size(), 0);
    MarkPiece(*first, &in_piece);
    for (const NodeIdx node : component) {
      if (kept_[node] == 0 || in_piece[node] != 0) continue;
      for (const NodeIdx link : PathTo(in_piece)) kept_[link] = 1;
      MarkPiece(*first, &in_piece);
    }
  }

  // The nodes of a shortest path from the marked ones to another kept one.
  std::vector<NodeIdx> PathTo(const std::vector<char>& marked) const {
    std::vector<NodeIdx> from(kept_.size(), kNoNode);
    std::deque<NodeIdx> queue;
    for (NodeIdx node = 0; node < graph_.num_nodes(); ++node) {
      if (marked[node] != 0) queue.push_back(node);
    }
    while (!queue.empty()) {
      const NodeIdx node = queue.front();
      queue.pop_front();
      for (const AppearanceGraph::Neighbour& neighbour : graph_.Neighbours(node)) {
        if (marked[neighbour.node] != 0 || from[neighbour.node] != kNoNode) continue;
        from[neighbour.node] = node;
        if (kept_[neighbour.node] != 0) {
          std::vector<NodeIdx> path;
          for (NodeIdx at = node; marked[at] == 0; at = from[at]) path.push_back(at);
          return path;
        }
        queue.push_back(neighbour.node);
      }
    }
    return {};
  }

  const Appearance& appearance_;
  const AppearanceGraph& graph_;
  std::vector<char> is_wanted_;
  std::vector<char> kept_;
};

}  // namespace

void KeepRoles(const std::vector<char>& was_kept, Appearance* appearance) {
  if (appearance->max_detour_links > 0) return;
  const std::vector<char> kept = RoleKeeper(was_kept, *appearance).Run();
  for (size_t node = 0; node < kept.size(); ++node) {
    NodeRole& role = appearance->nodes[node].role;
    if (kept[node] == 0) {
      role = NodeRole::kDropped;
    } else if (role == NodeRole::kDropped) {
      role = NodeRole::kDominating;
    }
  }
}

std::vector<char> WereKept(const Appearance& appearance, const Classes& classes, const MapRows& previous,
                           const PreviousMatches& matches) {
  std::vector<char> is_kept(previous.images.size(), 0);
  for (const MapAppearanceNode& node : previous.appearance) {
    for (const int32_t image : node.images) is_kept[image] = node.is_kept ? 1 : 0;
  }
  std::vector<char> were_kept;
  for (const AppearanceNode& node : appearance.nodes) {
    const int32_t image = PositionOf(classes.images, node.images[0]);
    const int32_t row = image < 0 ? kNotBefore : matches.row_of_image[image];
    were_kept.push_back(row == kNotBefore ? 0 : is_kept[row]);
  }
  return were_kept;
}

}  // namespace cairn::emit_map
