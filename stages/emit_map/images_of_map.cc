#include "stages/emit_map/images_of_map.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "core/promise/later_views.h"
#include "core/promise/view_distance.h"

namespace cairn::emit_map {
namespace {

constexpr NodeIdx kNoNode = -1;

// Per node, the node that it becomes one with: itself where one of its images is listed.
std::vector<NodeIdx> StandIns(const Appearance& appearance, const Classes& classes,
                              const ImagesOfMap& images) {
  std::vector<NodeIdx> node_of_row(images.listed.size(), kNoNode);
  const auto row_of = [&](ImageId image_id) {
    const int32_t image = PositionOf(classes.images, image_id);
    return image < 0 ? -1 : images.row_of_image[image];
  };
  const auto is_listed = [&](ImageId image_id) {
    const int32_t image = PositionOf(classes.images, image_id);
    return image >= 0 && images.Lists(image);
  };
  for (size_t node = 0; node < appearance.nodes.size(); ++node) {
    for (const ImageId image_id : appearance.nodes[node].images) {
      if (is_listed(image_id)) node_of_row[row_of(image_id)] = static_cast<NodeIdx>(node);
    }
  }
  std::vector<NodeIdx> stand_ins;
  for (size_t node = 0; node < appearance.nodes.size(); ++node) {
    const std::vector<ImageId>& of_node = appearance.nodes[node].images;
    NodeIdx stand_in = static_cast<NodeIdx>(node);
    if (std::none_of(of_node.begin(), of_node.end(), is_listed)) {
      const auto first = std::find_if(of_node.begin(), of_node.end(),
                                      [&](ImageId image_id) { return row_of(image_id) >= 0; });
      if (first != of_node.end() && node_of_row[row_of(*first)] != kNoNode)
        stand_in = node_of_row[row_of(*first)];
    }
    stand_ins.push_back(stand_in);
  }
  return stand_ins;
}

}  // namespace

ImagesOfMap ChooseImages(const Classes& classes, bool all_images) {
  const size_t num_images = classes.images.size();
  std::vector<int32_t> later(num_images, -1);
  if (!all_images && classes.sessions.size() > 1) {
    later = LaterViews(classes, ViewDistance(classes, {}));
    for (const PlaceChange& change : classes.changes) {
      for (const ImageId image_id : {change.image_before, change.image_after}) {
        if (const int32_t image = PositionOf(classes.images, image_id); image >= 0) later[image] = -1;
      }
    }
  }
  ImagesOfMap images{.listed = ImagesOfToday(later), .row_of_image = {}};
  for (size_t i = 0; i < num_images; ++i) {
    const int32_t shown_by = later[i] < 0 ? static_cast<int32_t>(i) : later[i];
    images.row_of_image.push_back(static_cast<int32_t>(
        std::lower_bound(images.listed.begin(), images.listed.end(), shown_by) - images.listed.begin()));
  }
  return images;
}

Appearance OfListedImages(const Appearance& appearance, const Classes& classes, const ImagesOfMap& images) {
  const std::vector<NodeIdx> stand_ins = StandIns(appearance, classes, images);
  std::vector<NodeIdx> number(appearance.nodes.size(), kNoNode);
  Appearance merged = appearance;
  merged.nodes.clear();
  for (size_t node = 0; node < appearance.nodes.size(); ++node) {
    if (stand_ins[node] != static_cast<NodeIdx>(node)) continue;
    number[node] = static_cast<NodeIdx>(merged.nodes.size());
    merged.nodes.push_back(appearance.nodes[node]);
  }
  const auto merged_node = [&](NodeIdx node) { return number[stand_ins[node]]; };
  for (size_t node = 0; node < appearance.nodes.size(); ++node) {
    NodeRole& role = merged.nodes[merged_node(static_cast<NodeIdx>(node))].role;
    if (role == NodeRole::kDropped) role = appearance.nodes[node].role;
  }
  std::vector<AppearanceLink> links;
  for (AppearanceLink link : appearance.graph.Links()) {
    std::tie(link.node1, link.node2) = std::minmax({merged_node(link.node1), merged_node(link.node2)});
    if (link.node1 != link.node2) links.push_back(link);
  }
  merged.graph = AppearanceGraph(static_cast<int>(merged.nodes.size()), std::move(links));
  std::map<std::pair<NodeIdx, NodeIdx>, double> scores;
  for (const ConfusablePair& pair : appearance.confusable) {
    const std::pair<NodeIdx, NodeIdx> nodes = std::minmax({merged_node(pair.node1), merged_node(pair.node2)});
    if (nodes.first != nodes.second) scores[nodes] = std::max(scores[nodes], pair.score);
  }
  merged.confusable.clear();
  for (const auto& [nodes, score] : scores) merged.confusable.push_back({nodes.first, nodes.second, score});
  return merged;
}

}  // namespace cairn::emit_map
