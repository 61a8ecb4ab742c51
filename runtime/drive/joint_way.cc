#include "runtime/drive/joint_way.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <queue>
#include <tuple>

#include "runtime/drive/ways_to_goal.h"
#include "runtime/map/appearance_map.h"

namespace cairn {
namespace {

// A node shows what a robot sees that stands within this distance and turn of its image: a lattice of 0.6 m
// with images every 45 degrees has one for each pose.
constexpr double kSameStartM = 1;
constexpr double kSameHeadingDeg = 40;

// Of starts that cannot be told from the followed one so far: bit j for start j.
using Starts = uint64_t;

class JointSearch {
 public:
  JointSearch(const AppearanceMap& appearance, const std::vector<Pose>& node_poses,
              const std::vector<PossibleStart>& starts, NodeIdx goal, const RouteOptions& options,
              bool replans)
      : appearance_(appearance),
        node_poses_(node_poses),
        starts_(starts),
        goal_(goal),
        costs_(appearance, node_poses, options),
        wrong_place_m_(options.wrong_place_m),
        replans_(replans),
        ways_(FindWaysToGoal(appearance, goal, costs_)) {}

  JointWay Plan(int followed) {
    followed_ = followed;
    known_.clear();
    Starts others = 0;
    for (size_t j = 0; j < starts_.size() && j < 64 && !node_poses_.empty(); ++j) {
      if (static_cast<int>(j) != followed) others |= Starts{1} << j;
    }
    double before = 0;  // what the starts that are told apart at once cost
    for (size_t j = 0; j < starts_.size(); ++j) {
      if (static_cast<int>(j) != followed && !(j < 64 && (others >> j & 1)))
        before += starts_[j].probability * ways_.cost[starts_[j].node];
    }
    JointWay way = Search({starts_[followed].node, others});
    way.expected_cost += before;
    return way;
  }

 private:
  struct State {
    NodeIdx node = 0;
    Starts left = 0;
    auto operator<=>(const State&) const = default;
  };
  struct Known {
    double cost = 0;
    int num_links = 0;
    State before;
  };

  // A state without starts left, or at the goal, is an end: from there the best way is known.
  JointWay Search(const State& start) {
    using Entry = std::tuple<double, int, State, bool>;  // whether what the end costs is included
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    known_[start] = {0, 0, start};
    open.emplace(0, 0, start, false);
    while (!open.empty()) {
      const auto [cost, num_links, state, is_end] = open.top();
      open.pop();
      if (is_end) return {WayThrough(state), cost};
      const Known& known = known_[state];
      if (std::tie(cost, num_links) > std::tie(known.cost, known.num_links)) continue;
      if (state.left == 0 || state.node == goal_) {
        open.emplace(cost + CostOfEnd(state), num_links, state, true);
        continue;
      }
      if (state.node != start.node && !appearance_.is_kept[state.node]) continue;
      for (const AppearanceGraph::Neighbour& neighbour : appearance_.graph.Neighbours(state.node)) {
        if (std::isinf(ways_.cost[neighbour.node])) continue;
        const auto [next, told_apart_cost] = Arrive(neighbour.node, state.left);
        const double through =
            cost + costs_.Of(state.node, neighbour) * ShareWhoGo(state.left) + told_apart_cost;
        const auto found = known_.find(next);
        if (found != known_.end() &&
            std::tie(found->second.cost, found->second.num_links) <= std::tuple(through, num_links + 1))
          continue;
        known_[next] = {through, num_links + 1, state};
        open.emplace(through, num_links + 1, next, false);
      }
    }
    return {};  // not reached: there is a way
  }

  // Probability that the robot goes on, and as often as it will go the same way back.
  double ShareWhoGo(Starts left) const {
    double share = starts_[followed_].probability;
    for (size_t j = 0; j < starts_.size(); ++j) {
      if (IsLeft(left, j)) share += (replans_ ? 1 : 2) * starts_[j].probability;
    }
    return share;
  }

  double CostOfEnd(const State& end) const {
    double cost = starts_[followed_].probability * ways_.cost[end.node];
    for (size_t j = 0; j < starts_.size(); ++j) {
      if (IsLeft(end.left, j))
        cost += starts_[j].probability * (wrong_place_m_ + ways_.cost[starts_[j].node]);
    }
    return cost;
  }

  // What is left at a node, and the cost of those who are told apart there.
  std::pair<State, double> Arrive(NodeIdx node, Starts left) const {
    State state{node, left};
    double cost = 0;
    for (size_t j = 0; j < starts_.size(); ++j) {
      if (!IsLeft(left, j)) continue;
      const Pose from_other = PoseFrom(j, node);
      if (LooksAlikeAt(node, from_other)) continue;
      state.left &= ~(Starts{1} << j);
      const NodeIdx by_then = replans_ ? NodeAt(from_other) : -1;
      cost += starts_[j].probability * ways_.cost[by_then >= 0 ? by_then : starts_[j].node];
    }
    return {state, cost};
  }

  // Where the robot is if it moved from start j as it would from the followed start to the node.
  Pose PoseFrom(size_t j, NodeIdx node) const {
    const Pose world_from_world =
        node_poses_[starts_[j].node].Inverse() * node_poses_[starts_[followed_].node];
    return node_poses_[node] * world_from_world.Inverse();
  }

  bool ShowsPlace(NodeIdx node, const Pose& pose) const {
    return CenterErrorM(node_poses_[node], pose) <= kSameStartM &&
           RotationErrorDeg(node_poses_[node], pose) <= kSameHeadingDeg;
  }

  bool LooksAlikeAt(NodeIdx node, const Pose& pose) const {
    return std::ranges::any_of(appearance_.look_alikes[node],
                               [&](const auto& other) { return ShowsPlace(other.node, pose); });
  }

  // The nearest node that shows the place and leads to the goal; -1: none.
  NodeIdx NodeAt(const Pose& pose) const {
    NodeIdx nearest = -1;
    for (NodeIdx node = 0; node < appearance_.graph.num_nodes(); ++node) {
      if (std::isinf(ways_.cost[node]) || !ShowsPlace(node, pose)) continue;
      if (nearest < 0 || CenterErrorM(node_poses_[node], pose) < CenterErrorM(node_poses_[nearest], pose))
        nearest = node;
    }
    return nearest;
  }

  // Its own cost is that of links for a robot that did start there.
  NodePath WayThrough(const State& end) {
    NodePath path{.nodes = ways_.From(end.node), .cost = ways_.cost[end.node]};
    for (State state = end; known_[state].before != state; state = known_[state].before) {
      const NodeIdx before = known_[state].before.node;
      path.nodes.insert(path.nodes.begin(), before);
      for (const AppearanceGraph::Neighbour& neighbour : appearance_.graph.Neighbours(before)) {
        if (neighbour.node == state.node) path.cost += costs_.Of(before, neighbour);
      }
    }
    return path;
  }

  static bool IsLeft(Starts left, size_t j) { return j < 64 && (left >> j & 1); }

  const AppearanceMap& appearance_;
  const std::vector<Pose>& node_poses_;
  const std::vector<PossibleStart>& starts_;
  const NodeIdx goal_;
  const LinkCosts costs_;
  const double wrong_place_m_;
  const bool replans_;
  const WaysToGoal ways_;
  int followed_ = 0;
  std::map<State, Known> known_;
};

}  // namespace

std::vector<JointWay> FindJointWays(const AppearanceMap& appearance, const std::vector<Pose>& node_poses,
                                    const std::vector<PossibleStart>& starts, NodeIdx goal,
                                    const RouteOptions& options, bool replans) {
  JointSearch search(appearance, node_poses, starts, goal, options, replans);
  std::vector<JointWay> ways;
  for (size_t i = 0; i < starts.size(); ++i) ways.push_back(search.Plan(static_cast<int>(i)));
  return ways;
}

}  // namespace cairn
