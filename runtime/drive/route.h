#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/geometry/pose.h"
#include "core/options/options.h"

namespace cairn {

class Map;             // runtime/map/map.h
struct AppearanceMap;  // runtime/map/appearance_map.h

struct RouteOptions {
  // The cost of a link, summed over a way: "links": 1 each; "matches": 1 / verified inliers, as in the
  // planner that [Mariottini11 §V] compares with; "entropy": the mean of the entropies at both ends
  // [Mariottini11 eq. 2], so that the way leads through places that the robot can recognise.
  std::string weight = "links";
};
OptionTable DescribeOptions(RouteOptions* options);

// A way over nodes of the appearance graph.
struct NodePath {
  std::vector<NodeIdx> nodes;  // the start, ..., the goal; one where they are the same
  double cost = 0;             // sum of the links' weights
  double MeanCost() const { return nodes.size() < 2 ? 0 : cost / static_cast<double>(nodes.size() - 1); }
};

// From each start the way of least cost to the goal over kept nodes (its ends may be others) [Booij06 §IV:
// paths over the connected dominating set; Mariottini11 §V: Dijkstra].  Among equal costs the way with the
// fewest links, then the one through the smallest nodes; nothing where there is no way.  O(links log links).
// REQUIRES: nodes of the graph.  Errors: InvalidArgument (no such weight), NotFound (weight "entropy" in a
// map without entropies).
Result<std::vector<std::optional<NodePath>>> FindPaths(const AppearanceMap& appearance,
                                                       const std::vector<NodeIdx>& starts, NodeIdx goal,
                                                       const RouteOptions& options);

// A way from image to image along which each shows what the next one shows: a robot that can steer by its
// camera follows it without a metric map [Booij06 §I].
struct Route {
  std::vector<int32_t> images;  // indices: the start, then one per place on the way, then the goal
  int num_links = 0;            // between places; 0: start and goal were taken at one place
  double cost = 0;              // sum of the links' weights
};

// FindPaths for two images.  Errors: the same; InvalidArgument (no such image), NotFound (the map has no
// appearance graph; one of the images is not in it; no path leads from one to the other), Corrupt (a
// damaged block).
Result<Route> PlanRoute(const Map& map, int32_t from, int32_t to, const RouteOptions& options = {});

// The index of a survey image by its name.  O(images).  Errors: NotFound (no such image), Corrupt.
Result<int32_t> FindImage(const Map& map, const std::string& name);

// Where a survey image was taken: cam_from_world, as a fix of the same pixels states it.  Errors:
// InvalidArgument (no such image), Corrupt.
Result<Pose> PoseOfImage(const Map& map, int32_t image);

}  // namespace cairn
