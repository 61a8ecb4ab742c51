#include "pipeline/commands/inspect_ambiguity.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/blocks/map_blocks.h"
#include "core/geometry/floor_pose.h"

namespace cairn::pipeline {
namespace {

bool KnowsAmbiguity(const MapRows& rows) {
  return !rows.appearance.empty() && rows.appearance.front().entropy.has_value();
}

const MapImage& FirstImage(const MapRows& rows, size_t node) {
  return rows.images[rows.appearance[node].images.front()];
}

// Look-alikes of every node, both ways.
std::vector<std::vector<MapAppearanceNode::LookAlike>> LookAlikes(const MapRows& rows) {
  std::vector<std::vector<MapAppearanceNode::LookAlike>> all(rows.appearance.size());
  for (size_t node = 0; node < all.size(); ++node) all[node] = rows.appearance[node].look_alikes;
  CompleteLookAlikes(&all);
  return all;
}

std::string LookAlikeText(const MapRows& rows, size_t node,
                          const std::vector<MapAppearanceNode::LookAlike>& look_alikes) {
  if (look_alikes.empty()) return "";
  const auto most = std::max_element(look_alikes.begin(), look_alikes.end(),
                                     [](const auto& a, const auto& b) { return a.score < b.score; });
  const MapImage& other = FirstImage(rows, most->node);
  return fmt::format(", like {}, {:.1f} m away (score {:.2f}){}", other.name,
                     CenterErrorM(FirstImage(rows, node).cam_from_world, other.cam_from_world), most->score,
                     look_alikes.size() > 1 ? fmt::format(" and {} more", look_alikes.size() - 1) : "");
}

}  // namespace

std::string AmbiguityText(const MapRows& rows, int max_num_places) {
  if (!KnowsAmbiguity(rows)) return "";
  const auto look_alikes = LookAlikes(rows);
  std::vector<size_t> order(rows.appearance.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return *rows.appearance[a].entropy > *rows.appearance[b].entropy;
  });
  if (order.size() > static_cast<size_t>(max_num_places)) order.resize(max_num_places);
  std::string text =
      "most ambiguous places (entropy in nats: 0 like no other, 0.69 like one other, 2.3 like nine)\n";
  for (const size_t node : order) {
    const MapImage& image = FirstImage(rows, node);
    const FloorPose place = FloorPoseOf(image.cam_from_world, rows.floor_from_world);
    text += fmt::format("  {:.2f}  {} ({:.2f}, {:.2f}, {:.0f} deg){}\n", *rows.appearance[node].entropy,
                        image.name, place.position.x(), place.position.y(), place.heading_deg,
                        LookAlikeText(rows, node, look_alikes[node]));
  }
  std::vector<RegionEntropy> regions = rows.findings.region_entropies;
  std::stable_sort(regions.begin(), regions.end(),
                   [](const RegionEntropy& a, const RegionEntropy& b) { return a.entropy > b.entropy; });
  if (regions.size() > static_cast<size_t>(max_num_places)) regions.resize(max_num_places);
  if (!regions.empty()) text += "\nmost ambiguous regions (mean of their images)\n";
  for (const RegionEntropy& region : regions)
    text += fmt::format("  {:.2f}  region {}\n", region.entropy, region.region);
  return text;
}

nlohmann::ordered_json AmbiguityJson(const MapRows& rows) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  if (!KnowsAmbiguity(rows)) return json;
  json["nodes"] = nlohmann::ordered_json::array();
  for (size_t node = 0; node < rows.appearance.size(); ++node) {
    nlohmann::ordered_json entry = {{"image", FirstImage(rows, node).name},
                                    {"entropy_nat", *rows.appearance[node].entropy},
                                    {"look_alikes", nlohmann::ordered_json::array()}};
    for (const MapAppearanceNode::LookAlike& other : rows.appearance[node].look_alikes)
      entry["look_alikes"].push_back({{"image", FirstImage(rows, other.node).name}, {"score", other.score}});
    json["nodes"].push_back(std::move(entry));
  }
  json["regions"] = nlohmann::ordered_json::array();
  for (const RegionEntropy& region : rows.findings.region_entropies)
    json["regions"].push_back({{"region", region.region}, {"entropy_nat", region.entropy}});
  return json;
}

}  // namespace cairn::pipeline
