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
  // [Mariottini11 eq. 2], so that the way leads through places that the robot can recognise; "risk": the
  // metres that a robot is expected to drive for it, those after it got lost included:
  //
  //   length + lost (look_anew_m + wrong_place_m P(wrong)),   lost = l + (1 - l) exp(-inliers / f)
  //
  // with l = lost_ratio, f = faint_link_inliers, and P(wrong) the mean over both ends of 1 - exp(-H): who
  // takes the likeliest place of an image of entropy H is not wrong more often; 1/2 at twins.  The length is
  // that of a robot on wheels, which retreats and comes in to get sideways (four metres a metre); a turn
  // counts as the way driven meanwhile.  In a map without scale every link is a metre long.
  std::string weight = "links";
  // The rest is for "risk" alone.  Share of the images on its way at which a robot is lost (carried, blocked,
  // dazzled), however well they match.  REQUIRES: in [0, 1]
  double lost_ratio = 0.05;
  // With this many matches, an image is not found again in 1 of e = 2.7 cases.  REQUIRES: > 0
  double faint_link_inliers = 10;
  // What it costs to look anew, and to take a wrong place for the right one, as metres of way: the larger,
  // the longer detours are made through places that are like no other.  At 100 m ways were as long as those
  // of fewest images (bench/drive); the way in a wrong belief was 4 m.  REQUIRES: >= 0
  double look_anew_m = 1;
  double wrong_place_m = 100;
};
OptionTable DescribeOptions(RouteOptions* options);

// A way over nodes of the appearance graph.
struct NodePath {
  std::vector<NodeIdx> nodes;  // the start, ..., the goal; one where they are the same
  double cost = 0;             // sum of the links' weights
  double MeanCost() const { return nodes.size() < 2 ? 0 : cost / static_cast<double>(nodes.size() - 1); }
};

// cam_from_world of each node's first image, for FindPaths; empty for a map without scale.  Reads all images.
// Errors: as Map::Image.
Result<std::vector<Pose>> NodePoses(const Map& map);

// From each start the way of least cost to the goal over kept nodes (its ends may be others) [Booij06 §IV:
// paths over the connected dominating set; Mariottini11 §V: Dijkstra].  Among equal costs the way with the
// fewest links, then the one through the smallest nodes; nothing where there is no way.  O(links log links).
// `node_poses` is read for weight "risk".  REQUIRES: nodes of the graph.  Errors: InvalidArgument (an
// option), NotFound (weight "entropy" or "risk" in a map without entropies).
Result<std::vector<std::optional<NodePath>>> FindPaths(const AppearanceMap& appearance,
                                                       const std::vector<Pose>& node_poses,
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
