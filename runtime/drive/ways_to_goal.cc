#include "runtime/drive/ways_to_goal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>

#include "runtime/map/appearance_map.h"

namespace cairn {
namespace {

// Way that a robot drives while it could turn by a radian: 0.5 m/s and 60 degrees/s, ServoOptions' limits.
constexpr double kTurnMPerRad = 0.5;
// A robot with wheels does not move sideways.  What lies beside the way ahead by up to this part of it, the
// tangent of 22 degrees, the servo approaches (servo.h: max_heading_deg); for what is beyond it retreats, its
// heading turned by h = 28 degrees, and comes in: 1 / sin h + 1 / tan h metres for each metre.
constexpr double kApproachableRatio = 0.4;
constexpr double kRetreatMPerM = 4;

// The most that a robot can be wrong which takes the likeliest of the places that an image of this entropy
// (nats) may show: H = -sum p ln p >= -ln max p, so 1 - max p <= 1 - exp(-H).  Twins: 1/2.
double WrongRatio(double entropy) { return 1 - std::exp(-entropy); }

}  // namespace

double LinkCosts::LengthM(NodeIdx node, NodeIdx neighbour) const {
  if (node_poses_.empty()) return 1;
  const Pose &a = node_poses_[node], &b = node_poses_[neighbour];
  const Eigen::Vector3d way = b.Center() - a.Center();
  double retreat_m = 0;  // the mean over both directions
  for (const Pose* target : {&a, &b}) {
    const double ahead = std::abs(way.dot(target->ViewingDirection()));
    const double beside = std::sqrt(std::max(0.0, way.squaredNorm() - ahead * ahead));
    retreat_m += 0.5 * kRetreatMPerM * std::max(0.0, beside - kApproachableRatio * ahead);
  }
  return way.norm() + retreat_m + kTurnMPerRad * a.rotation.angularDistance(b.rotation);
}

double LinkCosts::ExpectedM(NodeIdx node, const AppearanceGraph::Neighbour& neighbour) const {
  const double not_found = std::exp(-neighbour.num_inliers / options_.faint_link_inliers);
  const double lost = options_.lost_ratio + (1 - options_.lost_ratio) * not_found;
  const double wrong =
      (WrongRatio(appearance_.entropy[node]) + WrongRatio(appearance_.entropy[neighbour.node])) / 2;
  return LengthM(node, neighbour.node) + lost * (options_.look_anew_m + options_.wrong_place_m * wrong);
}

double LinkCosts::Of(NodeIdx node, const AppearanceGraph::Neighbour& neighbour) const {
  // [Mariottini11 §V] the planner to compare with: the inverse of the number of matches
  if (options_.weight == "matches") return 1.0 / neighbour.num_inliers;
  // [Mariottini11 eq. 2] w_ij = (H_i + H_j) / 2
  if (options_.weight == "entropy")
    return (appearance_.entropy[node] + appearance_.entropy[neighbour.node]) / 2;
  if (options_.weight == "risk") return ExpectedM(node, neighbour);
  return 1;
}

std::vector<NodeIdx> WaysToGoal::From(NodeIdx start) const {
  std::vector<NodeIdx> nodes = {start};
  while (next[nodes.back()] != nodes.back()) nodes.push_back(next[nodes.back()]);
  return nodes;
}

// [Mariottini11 §V] Dijkstra, from the goal for all starts at once; a way's inner nodes are kept ones.  Links
// may cost nothing: of ways that cost the same the one of fewest links is taken, so that none is a circle.
WaysToGoal FindWaysToGoal(const AppearanceMap& appearance, NodeIdx goal, const LinkCosts& costs) {
  const size_t num_nodes = appearance.is_kept.size();
  WaysToGoal ways{std::vector<double>(num_nodes, std::numeric_limits<double>::infinity()),
                  std::vector<int>(num_nodes, std::numeric_limits<int>::max()),
                  std::vector<NodeIdx>(num_nodes, -1)};
  using Entry = std::tuple<double, int, NodeIdx>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  ways.cost[goal] = 0;
  ways.num_links[goal] = 0;
  ways.next[goal] = goal;
  open.emplace(0, 0, goal);
  while (!open.empty()) {
    const auto [cost, num_links, node] = open.top();
    open.pop();
    const bool is_old = std::tie(cost, num_links) > std::tie(ways.cost[node], ways.num_links[node]);
    if (is_old || (node != goal && !appearance.is_kept[node])) continue;
    // [Booij06 §IV-A] all original links among kept nodes count, not those of a tree alone
    for (const AppearanceGraph::Neighbour& neighbour : appearance.graph.Neighbours(node)) {
      const NodeIdx other = neighbour.node;
      const auto through = std::tuple(cost + costs.Of(node, neighbour), num_links + 1);
      auto known = std::tie(ways.cost[other], ways.num_links[other]);
      if (other == goal || through > known || (through == known && node >= ways.next[other])) continue;
      if (through < known) open.emplace(std::get<0>(through), num_links + 1, other);
      known = through;
      ways.next[other] = node;
    }
  }
  return ways;
}

}  // namespace cairn
