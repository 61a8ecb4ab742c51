#include "runtime/drive/route.h"

#include <algorithm>
#include <limits>
#include <queue>
#include <tuple>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/world/appearance_graph.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

double LinkWeight(const AppearanceMap& appearance, const RouteOptions& options, NodeIdx node,
                  const AppearanceGraph::Neighbour& neighbour) {
  // [Mariottini11 §V] the planner to compare with: the inverse of the number of matches
  if (options.weight == "matches") return 1.0 / neighbour.num_inliers;
  // [Mariottini11 eq. 2] w_ij = (H_i + H_j) / 2
  if (options.weight == "entropy") return (appearance.entropy[node] + appearance.entropy[neighbour.node]) / 2;
  return 1;
}

// Per node what the way to the goal costs, how many links it has and what it leads to next; -1: no way.
struct Ways {
  std::vector<double> cost;
  std::vector<int> num_links;
  std::vector<NodeIdx> next;
};

// [Mariottini11 §V] Dijkstra, from the goal for all starts at once; a way's inner nodes are kept ones.  Links
// may cost nothing: of ways that cost the same the one of fewest links is taken, so that none is a circle.
Ways WaysTo(const AppearanceMap& appearance, NodeIdx goal, const RouteOptions& options) {
  const size_t num_nodes = appearance.is_kept.size();
  Ways ways{std::vector<double>(num_nodes, std::numeric_limits<double>::infinity()),
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
      const auto through = std::tuple(cost + LinkWeight(appearance, options, node, neighbour), num_links + 1);
      auto known = std::tie(ways.cost[other], ways.num_links[other]);
      if (other == goal || through > known || (through == known && node >= ways.next[other])) continue;
      if (through < known) open.emplace(std::get<0>(through), num_links + 1, other);
      known = through;
      ways.next[other] = node;
    }
  }
  return ways;
}

Status CheckImage(const Map& map, int32_t image) {
  if (image >= 0 && image < map.num_images()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "route: image {} of {}", image, map.num_images());
}

}  // namespace

OptionTable DescribeOptions(RouteOptions* options) {
  return {{.name = "weight",
           .value = &options->weight,
           .help = "what the way minimises: the number of links, the sum of 1 / matches of links, or the "
                   "entropy of places",
           .choices = {"links", "matches", "entropy"}}};
}

Result<std::vector<std::optional<NodePath>>> FindPaths(const AppearanceMap& appearance,
                                                       const std::vector<NodeIdx>& starts, NodeIdx goal,
                                                       const RouteOptions& options) {
  RouteOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (options.weight == "entropy" && appearance.entropy.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "route: the map does not say how ambiguous its places are; compile it again, or plan by "
                     "links or matches");
  }
  const Ways ways = WaysTo(appearance, goal, options);
  std::vector<std::optional<NodePath>> paths;
  for (const NodeIdx start : starts) {
    std::optional<NodePath>& path = paths.emplace_back();
    if (ways.next[start] < 0) continue;
    path = NodePath{.nodes = {start}, .cost = ways.cost[start]};
    while (path->nodes.back() != goal) path->nodes.push_back(ways.next[path->nodes.back()]);
  }
  return paths;
}

Result<Route> PlanRoute(const Map& map, int32_t from, int32_t to, const RouteOptions& options) {
  for (const int32_t image : {from, to}) CAIRN_RETURN_IF_ERROR(CheckImage(map, image));
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map.Appearance());
  if (appearance->is_kept.empty()) {
    return MakeError(
        ErrorCode::kNotFound,
        "route: map '{}' has no appearance graph; compile it again, or give --appearance to emit-map",
        map.head().name);
  }
  const NodeIdx start = appearance->node_of_image[from], goal = appearance->node_of_image[to];
  if (start < 0 || goal < 0) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(start < 0 ? from : to));
    return MakeError(ErrorCode::kNotFound, "route: image {} is not in the appearance graph", image->name);
  }
  if (from == to) return Route{.images = {from}};
  CAIRN_ASSIGN_OR_RETURN(const auto paths, FindPaths(*appearance, {start}, goal, options));
  if (!paths[0]) {
    CAIRN_ASSIGN_OR_RETURN(const auto first, map.Image(from));
    CAIRN_ASSIGN_OR_RETURN(const auto last, map.Image(to));
    return MakeError(
        ErrorCode::kNotFound,
        "route: no path over kept images leads from {} to {}; they are in different parts of the "
        "appearance graph: survey the way between them",
        first->name, last->name);
  }
  const std::vector<NodeIdx>& nodes = paths[0]->nodes;
  Route route{.images = {from}, .num_links = static_cast<int>(nodes.size()) - 1, .cost = paths[0]->cost};
  for (size_t i = 1; i + 1 < nodes.size(); ++i)
    route.images.push_back(appearance->node_images[nodes[i]].front());
  route.images.push_back(to);
  return route;
}

Result<int32_t> FindImage(const Map& map, const std::string& name) {
  for (int64_t ordinal = 0; ordinal < map.directory().NumBlocks(BlockKind::kImages); ++ordinal) {
    CAIRN_ASSIGN_OR_RETURN(const auto block, map.Images(ordinal));
    for (size_t i = 0; i < block->images.size(); ++i) {
      if (block->images[i].name == name) return block->first + static_cast<int32_t>(i);
    }
  }
  return MakeError(ErrorCode::kNotFound,
                   "map '{}' has no survey image '{}'; `cairn export` lists their names", map.head().name,
                   name);
}

Result<Pose> PoseOfImage(const Map& map, int32_t image) {
  CAIRN_RETURN_IF_ERROR(CheckImage(map, image));
  CAIRN_ASSIGN_OR_RETURN(const auto of_map, map.Image(image));
  return map.head().camera_from_given.Inverse() * of_map->cam_from_world;
}

}  // namespace cairn
