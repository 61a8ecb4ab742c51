#pragma once

#include <optional>
#include <vector>

#include "core/base/ids.h"
#include "core/geometry/pose.h"
#include "runtime/drive/route.h"

namespace cairn {

// A node at which the robot may have started, and how probably.
struct PossibleStart {
  NodeIdx node = 0;
  double probability = 0;
};

// The way that is followed first if one of the possible starts is taken for the right one.
struct JointWay {
  NodePath path;             // from that start to the goal, and its own cost
  double expected_cost = 0;  // of following it first, over all possible starts
};

// Plans for a robot that does not know at which of several places it started: for each start the way to the
// goal of least expected cost, were that start taken for the right one.  Such a way may lead by a place that
// tells the starts apart although another one is shorter.  With p_i the probability of start i, c the cost of
// links and V(n) the least cost from node n to the goal, the way w of start i costs
//
//   E(w) = p_i c(w) + sum over j != i of p_j (f c(w until it is told from j) + V_j)
//   f = 2, V_j = V(start j)                              where the robot then goes back to its start
//   f = 1, V_j = V(where it is by then if it began at j)  where it plans anew from there (`replans`)
//
// A robot that moves along w from start i would move alike from start j.  The two are told apart at the first
// node of w of which the map knows no look-alike (AppearanceMap::look_alikes) there; if that is none, the
// robot stops at the wrong place, which costs RouteOptions::wrong_place_m in addition.  Look-alikes stand for
// the divergence of [Mariottini11 eq. 7], because what the map expects of a node includes that node's own
// image, which is most like itself: by it no twins are alike.
//
// Exact: Dijkstra over (node, starts not yet told apart), whose links cost c times p_i + f (sum of p_j left).
// In a map without scale nothing says where the robot would be from another start: starts count as told apart
// at once.  At most 64 starts.  REQUIRES: a way to the goal from each start; look-alikes in the map.
std::vector<JointWay> FindJointWays(const AppearanceMap& appearance, const std::vector<Pose>& node_poses,
                                    const std::vector<PossibleStart>& starts, NodeIdx goal,
                                    const RouteOptions& options, bool replans);

}  // namespace cairn
