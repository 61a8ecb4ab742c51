#include "runtime/drive/route.h"

#include <utility>

#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "runtime/drive/ways_to_goal.h"
#include "runtime/map/appearance_map.h"
#include "runtime/map/map.h"

namespace cairn {
namespace {

Status CheckImage(const Map& map, int32_t image) {
  if (image >= 0 && image < map.num_images()) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "route: image {} of {}", image, map.num_images());
}

}  // namespace

OptionTable DescribeOptions(RouteOptions* options) {
  OptionTable table = {
      {.name = "weight",
       .value = &options->weight,
       .help = "what the way minimises: the number of links, the sum of 1 / matches of links, the entropy of "
               "places, or the metres expected with what getting lost there costs",
       .choices = {"links", "matches", "entropy", "risk"}},
      {.name = "lost_ratio",
       .value = &options->lost_ratio,
       .help = "share of the images on its way at which a robot is lost, however well they match",
       .min = 0,
       .max = 1},
      {.name = "faint_link_inliers",
       .value = &options->faint_link_inliers,
       .help = "with this many matches an image is not found again in 1 of 2.7 cases",
       .min = 0.1},
      {.name = "look_anew_m",
       .value = &options->look_anew_m,
       .help = "what it costs to look anew, as metres of way",
       .min = 0},
      {.name = "wrong_place_m",
       .value = &options->wrong_place_m,
       .help = "what it costs to take a wrong place for the right one, as metres of way: the larger, the "
               "longer detours are made through places that are like no other",
       .min = 0},
  };
  AddCondition({"weight", {"risk"}}, {"lost_ratio", "faint_link_inliers", "look_anew_m", "wrong_place_m"},
               &table);
  return table;
}

Result<std::vector<Pose>> NodePoses(const Map& map) {
  std::vector<Pose> poses;
  if (!IsMetric(map.head().frame)) return poses;
  CAIRN_ASSIGN_OR_RETURN(const auto appearance, map.Appearance());
  for (const std::vector<int32_t>& images : appearance->node_images) {
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(images.front()));
    poses.push_back(image->cam_from_world);
  }
  return poses;
}

Result<std::vector<std::optional<NodePath>>> FindPaths(const AppearanceMap& appearance,
                                                       const std::vector<Pose>& node_poses,
                                                       const std::vector<NodeIdx>& starts, NodeIdx goal,
                                                       const RouteOptions& options) {
  RouteOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  const bool needs_entropy = options.weight == "entropy" || options.weight == "risk";
  if (needs_entropy && appearance.entropy.empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "route: the map does not say how ambiguous its places are; compile it again, or plan by "
                     "links or matches");
  }
  const WaysToGoal ways = FindWaysToGoal(appearance, goal, LinkCosts(appearance, node_poses, options));
  std::vector<std::optional<NodePath>> paths;
  for (const NodeIdx start : starts) {
    std::optional<NodePath>& path = paths.emplace_back();
    if (ways.next[start] >= 0) path = NodePath{.nodes = ways.From(start), .cost = ways.cost[start]};
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
  std::vector<Pose> node_poses;
  if (options.weight == "risk") {
    CAIRN_ASSIGN_OR_RETURN(node_poses, NodePoses(map));
  }
  CAIRN_ASSIGN_OR_RETURN(const auto paths, FindPaths(*appearance, node_poses, {start}, goal, options));
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
