#include "runtime/route.h"

#include <algorithm>

namespace cairn {
namespace {

// Predecessors on shortest paths from `start` over kept nodes; -1: not reached.  A path ends at a node that
// is not kept. All links count alike: breadth first is Dijkstra's order.
std::vector<NodeIdx> Predecessors(const AppearanceMap& appearance, NodeIdx start) {
  std::vector<NodeIdx> came_from(appearance.is_kept.size(), -1);
  came_from[start] = start;
  std::vector<NodeIdx> reached = {start};
  for (size_t i = 0; i < reached.size(); ++i) {
    if (reached[i] != start && !appearance.is_kept[reached[i]]) continue;
    for (const AppearanceGraph::Neighbour& n : appearance.graph.Neighbours(reached[i])) {
      if (came_from[n.node] >= 0) continue;
      came_from[n.node] = reached[i];
      reached.push_back(n.node);
    }
  }
  return came_from;
}

}  // namespace

Result<Route> PlanRoute(const Map& map, int32_t from, int32_t to) {
  for (const int32_t image : {from, to}) {
    if (image < 0 || image >= map.num_images()) {
      return MakeError(ErrorCode::kInvalidArgument, "route: image {} of {}", image, map.num_images());
    }
  }
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
  const std::vector<NodeIdx> came_from = Predecessors(*appearance, start);
  if (came_from[goal] < 0) {
    CAIRN_ASSIGN_OR_RETURN(const auto first, map.Image(from));
    CAIRN_ASSIGN_OR_RETURN(const auto last, map.Image(to));
    return MakeError(
        ErrorCode::kNotFound,
        "route: no path over kept images leads from {} to {}; they are in different parts of the "
        "appearance graph: survey the way between them",
        first->name, last->name);
  }
  Route route;
  if (from == to) return Route{.images = {from}};
  route.images.push_back(to);
  for (NodeIdx node = goal; node != start; node = came_from[node]) {
    ++route.num_links;
    if (node != goal) route.images.push_back(appearance->node_images[node].front());
  }
  route.images.push_back(from);
  std::reverse(route.images.begin(), route.images.end());
  return route;
}

}  // namespace cairn
