#include "stages/link_appearance/dominating_set/greedy_dominating_set.h"

#include <algorithm>
#include <limits>
#include <queue>

namespace cairn::link_appearance {
namespace {

// Count: integer type for shortfalls and gains; with half the size, twice as many nodes fit into the
// processor's nearest caches.
template <typename Count>
class Greedy {
 public:
  Greedy(const Domination& domination, size_t target_size)
      : domination_(domination),
        graph_(domination.graph()),
        target_size_(target_size),
        missing_(graph_.num_nodes(), 0),
        gains_(graph_.num_nodes(), 0),
        is_black_(graph_.num_nodes(), 0),
        is_gray_(graph_.num_nodes(), 0),
        is_started_(domination.components().nodes.size(), 0) {}

  void Keep(NodeIdx node) {
    if (is_black_[node]) return;
    is_black_[node] = 1;
    is_started_[domination_.components().component_of[node]] = 1;
    order_.push_back(node);
    SetMissing(node, 0);
    // [Booij06 §IV-B step 3] the node turns black, its white neighbours gray
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      if (is_black_[n.node]) continue;
      SetMissing(n.node, std::max<Count>(0, missing_[n.node] - Weight(n)));
      if (is_gray_[n.node]) continue;
      is_gray_[n.node] = 1;
      if (is_running_) queue_.push({gains_[n.node], n.node});
    }
  }

  // Continues until every node has what `demands` requires besides the nodes that are black, or until
  // the target.
  void Run(const Domination& demands) {
    is_running_ = true;
    // [Booij06 §IV-B step 1] all nodes white: each misses its demand
    for (NodeIdx node = 0; node < graph_.num_nodes(); ++node) {
      missing_[node] =
          static_cast<Count>(order_.empty() ? demands.Demand(node) : demands.Shortfall(node, is_black_));
    }
    for (NodeIdx node = 0; node < graph_.num_nodes(); ++node) {
      gains_[node] = missing_[node];
      for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
        gains_[node] += std::min(missing_[n.node], Weight(n));
      }
    }
    queue_ = {};
    for (NodeIdx node = 0; node < graph_.num_nodes(); ++node) {
      if (is_gray_[node] && !is_black_[node]) queue_.push({gains_[node], node});
    }
    QueueStarts();
    // [Booij06 §IV-B step 5] until no white node is left
    while (!queue_.empty() && order_.size() < target_size_) {
      // [Booij06 §IV-B step 4] the gray node with the most links to white ones
      const Candidate best = queue_.top();
      queue_.pop();
      if (best.gain > gains_[best.node] && !is_black_[best.node]) {
        queue_.push({gains_[best.node], best.node});  // gains only fall: the queue holds bounds
        continue;
      }
      // The component was started from another node meanwhile.
      const bool is_old_start =
          !is_gray_[best.node] && is_started_[domination_.components().component_of[best.node]];
      if (is_black_[best.node] || is_old_start) continue;
      if (best.gain == 0) break;
      Keep(best.node);
    }
  }

  bool IsFull() const { return order_.size() >= target_size_; }
  // [Booij06 §IV-B step 6] The black nodes.
  std::vector<NodeIdx> TakeOrder() { return std::move(order_); }

 private:
  struct Candidate {
    Count gain;
    NodeIdx node;
    bool operator<(const Candidate& other) const {
      return gain != other.gain ? gain < other.gain : node > other.node;
    }
  };

  // [Booij06 §IV-B step 2] The white node with the most neighbours, of each component without a black node.
  void QueueStarts() {
    for (size_t i = 0; i < domination_.components().nodes.size(); ++i) {
      if (is_started_[i]) continue;
      Candidate best{-1, 0};
      for (const NodeIdx node : domination_.components().nodes[i]) {
        best = std::max(best, Candidate{gains_[node], node});
      }
      queue_.push(best);
    }
  }

  Count Weight(const AppearanceGraph::Neighbour& n) const {
    return static_cast<Count>(domination_.Weight(n.num_inliers));
  }

  void SetMissing(NodeIdx node, Count missing) {
    const Count before = missing_[node];
    if (missing == before) return;
    missing_[node] = missing;
    gains_[node] -= before - missing;
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      const Count weight = Weight(n);
      gains_[n.node] -= std::min(before, weight) - std::min(missing, weight);
    }
  }

  const Domination& domination_;
  const AppearanceGraph& graph_;
  const size_t target_size_;
  std::vector<Count> missing_;
  std::vector<Count> gains_;  // what a node would contribute to itself and to its neighbours
  std::vector<char> is_black_, is_gray_, is_started_;
  bool is_running_ = false;
  std::priority_queue<Candidate> queue_;
  std::vector<NodeIdx> order_;
};

template <typename Count>
std::vector<NodeIdx> RunGreedy(const Domination& domination, int max_links, int target_size,
                               const std::vector<NodeIdx>& start) {
  const int num_nodes = domination.graph().num_nodes();
  Greedy<Count> greedy(domination, static_cast<size_t>(target_size < 0 ? num_nodes : target_size));
  for (const NodeIdx node : start) greedy.Keep(node);
  greedy.Run(domination);
  if (target_size < 0) return greedy.TakeOrder();
  DominationOptions more = domination.options();
  while (!greedy.IsFull() && more.num_dominators <= max_links) {
    ++more.num_dominators;
    greedy.Run(Domination(domination.graph(), more));
  }
  // The remaining nodes have no neighbour that could be kept for them.
  for (NodeIdx node = 0; node < num_nodes && !greedy.IsFull(); ++node) {
    if (domination.IsIn(node)) greedy.Keep(node);
  }
  return greedy.TakeOrder();
}

}  // namespace

std::vector<NodeIdx> GreedyDominatingSet(const Domination& domination, int target_size,
                                         const std::vector<NodeIdx>& start) {
  int max_links = 0;
  for (NodeIdx node = 0; node < domination.graph().num_nodes(); ++node) {
    max_links = std::max(max_links, domination.graph().NumNeighbours(node));
  }
  // Links to all neighbours, of full weight, are the largest sum that occurs.
  const int64_t most = (int64_t{max_links} + 1) * domination.options().strong_num_inliers;
  return most < std::numeric_limits<int32_t>::max()
             ? RunGreedy<int32_t>(domination, max_links, target_size, start)
             : RunGreedy<int64_t>(domination, max_links, target_size, start);
}

}  // namespace cairn::link_appearance
