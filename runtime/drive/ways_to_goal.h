#pragma once

#include <vector>

#include "core/base/ids.h"
#include "core/geometry/pose.h"
#include "core/world/appearance_graph.h"
#include "runtime/drive/route.h"

namespace cairn {

// What links cost by RouteOptions::weight.  What it is made of must outlive it.
class LinkCosts {
 public:
  // `node_poses`: as NodePoses returns them.  REQUIRES: options that FindPaths accepts for this map
  LinkCosts(const AppearanceMap& appearance, const std::vector<Pose>& node_poses, const RouteOptions& options)
      : appearance_(appearance), node_poses_(node_poses), options_(options) {}

  // >= 0; the same in both directions.
  double Of(NodeIdx node, const AppearanceGraph::Neighbour& neighbour) const;
  // Metres, a turn counting as the way that a robot drives meanwhile; 1 in a map without scale.
  double LengthM(NodeIdx node, NodeIdx neighbour) const;

 private:
  double ExpectedM(NodeIdx node, const AppearanceGraph::Neighbour& neighbour) const;

  const AppearanceMap& appearance_;
  const std::vector<Pose>& node_poses_;
  const RouteOptions& options_;
};

// Per node what the way of least cost to the goal costs, how many links it has and what it leads to next; -1:
// no way.
struct WaysToGoal {
  std::vector<double> cost;
  std::vector<int> num_links;
  std::vector<NodeIdx> next;

  // The nodes of the way: the start, ..., the goal.  REQUIRES: a way from there
  std::vector<NodeIdx> From(NodeIdx start) const;
};

// From all nodes at once; inner nodes are kept ones.  Among equal costs the way with the fewest links, then
// the one through the smallest nodes.  O(links log links).
WaysToGoal FindWaysToGoal(const AppearanceMap& appearance, NodeIdx goal, const LinkCosts& costs);

}  // namespace cairn
