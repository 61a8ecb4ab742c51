#include "pipeline/explain/inspect_drops.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/blocks/map_rows.h"
#include "pipeline/explain/station_text.h"

namespace cairn::pipeline {
namespace {

constexpr size_t kMaxReasonsOfStation = 4;

// "lost 120 few_observations, 30 not_chosen; in no region: few_features"
std::string LossesText(const std::vector<DropCount>& drops, size_t station) {
  std::vector<std::pair<int32_t, std::string>> losses;
  std::string in_no_region;
  for (const DropCount& drop : drops) {
    if (drop.at_stations.empty() || drop.at_stations[station] == 0) continue;
    if (drop.kind == "feature" || drop.kind == "view")
      losses.emplace_back(drop.at_stations[station], drop.name);
    if (drop.kind == "station") in_no_region = drop.name;
  }
  std::stable_sort(losses.begin(), losses.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  if (losses.size() > kMaxReasonsOfStation) losses.resize(kMaxReasonsOfStation);
  std::string text = losses.empty() ? "lost nothing" : "lost";
  for (size_t i = 0; i < losses.size(); ++i)
    text += fmt::format("{} {} {}", i > 0 ? "," : "", losses[i].first, losses[i].second);
  return in_no_region.empty() ? text : text + "; in no region: " + in_no_region;
}

}  // namespace

std::string DropsText(const MapRows& rows, int max_num_stations) {
  const std::vector<DropCount>& drops = rows.findings.drops;
  if (drops.empty()) return "";
  std::string text = "dropped\n";
  for (const DropCount& drop : drops) {
    text += fmt::format("  {:<18} {:<20} {:>9} {:<9} {}\n", drop.stage, drop.name, drop.num_dropped,
                        drop.kind + (drop.num_dropped == 1 ? "" : "s"), drop.text);
  }
  if (rows.landmark_choice != "regions") {
    text += fmt::format("  (landmarks = {}: features without a region can be landmarks all the same)\n",
                        rows.landmark_choice);
  }
  const std::vector<int> num_seen = LandmarksSeenAt(rows);
  std::vector<size_t> order(num_seen.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return num_seen[a] < num_seen[b]; });
  if (order.size() > static_cast<size_t>(max_num_stations)) order.resize(max_num_stations);
  text += "\nstations that see the fewest landmarks\n";
  for (const size_t station : order) {
    text += fmt::format("  {}: {} {}, {}\n", StationText(rows, static_cast<StationIdx>(station)),
                        num_seen[station], num_seen[station] == 1 ? "landmark" : "landmarks",
                        LossesText(drops, station));
  }
  return text;
}

nlohmann::ordered_json DropsJson(const MapRows& rows) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const DropCount& drop : rows.findings.drops) {
    list.push_back({{"reason_id", drop.reason_id},
                    {"stage", drop.stage},
                    {"kind", drop.kind},
                    {"name", drop.name},
                    {"text", drop.text},
                    {"num_dropped", drop.num_dropped},
                    {"at_stations", drop.at_stations}});
  }
  return list;
}

}  // namespace cairn::pipeline
