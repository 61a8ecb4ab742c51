#include "stages/link_appearance/dominating_set/improve_dominating_set.h"

#include <algorithm>
#include <tuple>

#include "core/base/random.h"
#include "stages/link_appearance/dominating_set/counting_bound.h"

namespace cairn::link_appearance {
namespace {

// A set that changes, with what each node still lacks.
class ChangingSet {
 public:
  ChangingSet(const Domination& domination, const std::vector<NodeIdx>& kept)
      : domination_(domination),
        graph_(domination.graph()),
        kept_(graph_.num_nodes(), 0),
        counted_(graph_.num_nodes(), 0),
        missing_(graph_.num_nodes(), 0),
        gains_(graph_.num_nodes(), 0),
        part_(graph_.num_nodes(), -1) {
    for (NodeIdx node = 0; node < graph_.num_nodes(); ++node) SetMissing(node);
    for (const NodeIdx node : kept) Add(node);
  }

  bool Has(NodeIdx node) const { return kept_[node]; }
  const std::vector<NodeIdx>& nodes() const { return nodes_; }
  int64_t total_missing() const { return total_missing_; }
  // By how much a node outside of the set would reduce total_missing().
  int64_t Gain(NodeIdx node) const { return gains_[node]; }

  void Add(NodeIdx node) {
    kept_[node] = 1;
    nodes_.insert(std::lower_bound(nodes_.begin(), nodes_.end(), node), node);
    Count(node, 1);
  }
  void Remove(NodeIdx node) {
    kept_[node] = 0;
    nodes_.erase(std::lower_bound(nodes_.begin(), nodes_.end(), node));
    Count(node, -1);
  }

  // By how much removing a kept node would increase total_missing().
  int64_t Loss(NodeIdx node) const {
    int64_t loss = std::max<int64_t>(0, domination_.Demand(node) - counted_[node]);
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      if (kept_[n.node]) continue;
      const int64_t slack = counted_[n.node] - domination_.Demand(n.node);
      loss += std::clamp<int64_t>(domination_.Weight(n.num_inliers) - std::max<int64_t>(0, slack), 0,
                                  domination_.Weight(n.num_inliers));
    }
    return loss;
  }

  // Numbers the connected parts of the set, PartOf() of its nodes.  `without`: a node left out of it.
  int CountParts(NodeIdx without = -1) {
    for (const NodeIdx node : nodes_) part_[node] = -1;
    int num_parts = 0;
    for (const NodeIdx start : nodes_) {
      if (part_[start] >= 0 || start == without) continue;
      stack_ = {start};
      part_[start] = num_parts;
      while (!stack_.empty()) {
        const NodeIdx node = stack_.back();
        stack_.pop_back();
        for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
          if (!kept_[n.node] || n.node == without || part_[n.node] >= 0) continue;
          part_[n.node] = num_parts;
          stack_.push_back(n.node);
        }
      }
      ++num_parts;
    }
    return num_parts;
  }
  int PartOf(NodeIdx node) const { return part_[node]; }
  // How many parts a node outside of the set is linked to.  REQUIRES: CountParts() since the last change
  int NumPartsAround(NodeIdx node) {
    parts_around_.clear();
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      if (kept_[n.node]) parts_around_.push_back(part_[n.node]);
    }
    std::sort(parts_around_.begin(), parts_around_.end());
    return static_cast<int>(std::unique(parts_around_.begin(), parts_around_.end()) - parts_around_.begin());
  }

 private:
  void Count(NodeIdx node, int sign) {
    SetMissing(node);
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      counted_[n.node] += sign * domination_.Weight(n.num_inliers);
      SetMissing(n.node);
    }
  }
  void SetMissing(NodeIdx node) {
    const int64_t before = missing_[node];
    const int64_t now = kept_[node] ? 0 : std::max<int64_t>(0, domination_.Demand(node) - counted_[node]);
    if (now == before) return;
    missing_[node] = now;
    total_missing_ += now - before;
    gains_[node] += now - before;
    for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
      const int64_t weight = domination_.Weight(n.num_inliers);
      gains_[n.node] += std::min(now, weight) - std::min(before, weight);
    }
  }

  const Domination& domination_;
  const AppearanceGraph& graph_;
  std::vector<char> kept_;
  std::vector<int64_t> counted_;  // by links to kept nodes
  std::vector<int64_t> missing_;  // 0 at kept nodes
  std::vector<int64_t> gains_;    // of a node and its neighbours
  std::vector<int> part_;
  std::vector<NodeIdx> nodes_;  // ascending
  int64_t total_missing_ = 0;
  std::vector<NodeIdx> stack_;
  std::vector<int> parts_around_;
};

class LocalSearch {
 public:
  // The set's nodes are all in one component of the graph.
  LocalSearch(const Domination& domination, const std::vector<NodeIdx>& kept, const ImproveOptions& options,
              uint64_t seed, int target_size, Progress* progress)
      : domination_(domination),
        graph_(domination.graph()),
        options_(options),
        random_(seed),
        target_size_(target_size),
        progress_(progress),
        set_(domination, kept),
        is_near_(graph_.num_nodes(), 0) {}

  std::vector<NodeIdx> Run() {
    if (target_size_ < 0) Prune();
    std::vector<NodeIdx> best = set_.nodes();
    int64_t least_missing = set_.total_missing();
    const size_t least_size = target_size_ < 0 ? CountingBound(graph_) : 0;
    for (int i = 0; i < options_.num_tries && best.size() > least_size; ++i) {
      if (progress_ && progress_->Cancelled()) break;
      if (progress_) progress_->Advance();
      TakeOut();
      const bool is_repaired = Repair(best.size());
      if (is_repaired && target_size_ < 0) Prune();
      const auto score = std::pair(set_.total_missing(), set_.nodes().size());
      if (is_repaired && score <= std::pair(least_missing, best.size())) {
        best = set_.nodes();
        least_missing = set_.total_missing();
      } else {
        GoBackTo(best);
      }
    }
    return best;
  }

 private:
  // Takes out kept nodes in rings around a random one; the nodes around them become near_.
  void TakeOut() {
    const int num_kept = static_cast<int>(set_.nodes().size());
    const int num_wanted =
        static_cast<int>(random_.UniformInt(1, std::min(num_kept, options_.max_num_taken_out)));
    for (const NodeIdx node : near_) is_near_[node] = 0;
    near_ = {set_.nodes()[random_.UniformInt(0, num_kept - 1)]};
    is_near_[near_[0]] = 1;
    int num_out = 0;
    size_t end_of_ring = 0;  // after two more rings than the last node taken out
    for (size_t i = 0; i < near_.size(); ++i) {
      const NodeIdx node = near_[i];
      if (set_.Has(node) && num_out < num_wanted) {
        set_.Remove(node);
        ++num_out;
        if (num_out == num_wanted) end_of_ring = near_.size();
      }
      if (num_out == num_wanted && i >= end_of_ring) continue;
      ring_.clear();
      for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
        if (!is_near_[n.node]) ring_.push_back(n.node);
      }
      // Which nodes of a ring are taken out is random.
      for (size_t k = ring_.size(); k > 1; --k) {
        std::swap(ring_[k - 1], ring_[random_.UniformInt(0, static_cast<int64_t>(k) - 1)]);
      }
      for (const NodeIdx next : ring_) {
        is_near_[next] = 1;
        near_.push_back(next);
      }
    }
  }

  // Adds nodes until the set dominates and is connected, or has `max_size` nodes.  Returns whether it is
  // connected, and dominates as far as it must.
  bool Repair(size_t max_size) {
    const int64_t unit = domination_.options().strong_num_inliers;
    for (;;) {
      const int num_parts = set_.CountParts();
      if (set_.total_missing() == 0 && num_parts <= 1 && target_size_ < 0) return true;
      if (set_.nodes().size() >= max_size) return num_parts <= 1 && target_size_ >= 0;
      NodeIdx best = -1;
      int64_t best_gain = 0;
      int num_equal = 0;
      for (const NodeIdx node : near_) {
        // Joining all parts is the most that its links to them can gain.
        if (set_.Has(node) ||
            set_.Gain(node) + unit * (std::max(1, num_parts) - 1) < std::max<int64_t>(1, best_gain))
          continue;
        const int num_around = set_.NumPartsAround(node);
        const int64_t gain = set_.Gain(node) + unit * (num_around - 1);
        if (gain <= 0 || gain < best_gain) continue;
        if (num_around == 0 && num_parts > 0 && target_size_ >= 0) continue;
        num_equal = gain == best_gain ? num_equal + 1 : 1;
        if (num_equal == 1 || random_.UniformInt(1, num_equal) == 1) best = node;
        best_gain = gain;
      }
      if (best < 0) best = NodeBetweenParts(num_parts);
      if (best < 0) best = AnyNeighbour();
      if (best < 0) return false;
      set_.Add(best);
    }
  }

  // A node next to the first part on a shortest path to another one; -1: none.
  NodeIdx NodeBetweenParts(int num_parts) {
    if (num_parts < 2) return -1;
    std::vector<NodeIdx> came_from(graph_.num_nodes(), -1);
    std::vector<NodeIdx> reached;
    for (const NodeIdx node : set_.nodes()) {
      if (set_.PartOf(node) != 0) continue;
      came_from[node] = node;
      reached.push_back(node);
    }
    for (size_t i = 0; i < reached.size(); ++i) {
      for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(reached[i])) {
        if (came_from[n.node] >= 0) continue;
        came_from[n.node] = reached[i];
        reached.push_back(n.node);
        if (!set_.Has(n.node)) continue;
        NodeIdx node = reached[i];
        while (set_.Has(came_from[node]) == false) node = came_from[node];
        return node;
      }
    }
    return -1;
  }

  // With a target size: any node next to the set, where no node gains anything.
  NodeIdx AnyNeighbour() const {
    if (target_size_ < 0) return -1;
    for (const NodeIdx node : near_) {
      if (set_.Has(node)) continue;
      for (const AppearanceGraph::Neighbour& n : graph_.Neighbours(node)) {
        if (set_.Has(n.node)) return node;
      }
    }
    return -1;
  }

  // Drops nodes that are needed neither to dominate others nor for connection, in random order.
  void Prune() {
    std::vector<NodeIdx> nodes = set_.nodes();
    for (size_t k = nodes.size(); k > 1; --k) {
      std::swap(nodes[k - 1], nodes[random_.UniformInt(0, static_cast<int64_t>(k) - 1)]);
    }
    for (const NodeIdx node : nodes) {
      if (set_.nodes().size() > 1 && set_.Loss(node) == 0 && set_.CountParts(node) <= 1) set_.Remove(node);
    }
  }

  void GoBackTo(const std::vector<NodeIdx>& nodes) {
    const std::vector<NodeIdx> now = set_.nodes();
    for (const NodeIdx node : now) {
      if (!std::binary_search(nodes.begin(), nodes.end(), node)) set_.Remove(node);
    }
    for (const NodeIdx node : nodes) {
      if (!set_.Has(node)) set_.Add(node);
    }
  }

  const Domination& domination_;
  const AppearanceGraph& graph_;
  const ImproveOptions& options_;
  Random random_;
  const int target_size_;
  Progress* const progress_;
  ChangingSet set_;
  std::vector<NodeIdx> near_, ring_;
  std::vector<char> is_near_;
};

}  // namespace

std::vector<NodeIdx> ImproveDominatingSet(const Domination& domination, const std::vector<NodeIdx>& kept,
                                          const ImproveOptions& options, uint64_t seed, int target_size,
                                          Progress* progress) {
  const AppearanceComponents& components = domination.components();
  std::vector<std::vector<NodeIdx>> kept_of(components.nodes.size());
  for (const NodeIdx node : kept) kept_of[components.component_of[node]].push_back(node);
  std::vector<NodeIdx> improved;
  for (size_t i = 0; i < kept_of.size(); ++i) {
    if (kept_of[i].empty()) continue;
    if (components.nodes[i].size() == 1) {
      improved.push_back(kept_of[i][0]);
      continue;
    }
    const AppearanceGraph graph = InducedSubgraph(domination.graph(), components.nodes[i]);
    const Domination part(graph, domination.options());
    std::vector<NodeIdx> part_kept;
    for (const NodeIdx node : kept_of[i]) {
      const auto found = std::lower_bound(components.nodes[i].begin(), components.nodes[i].end(), node);
      part_kept.push_back(static_cast<NodeIdx>(found - components.nodes[i].begin()));
    }
    const int part_target = target_size < 0 ? -1 : static_cast<int>(part_kept.size());
    LocalSearch search(part, part_kept, options, MixSeed(seed, i), part_target, progress);
    for (const NodeIdx node : search.Run()) improved.push_back(components.nodes[i][node]);
  }
  std::sort(improved.begin(), improved.end());
  return improved;
}

}  // namespace cairn::link_appearance
