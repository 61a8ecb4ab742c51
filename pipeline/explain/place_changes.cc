#include "pipeline/explain/place_changes.h"

#include <algorithm>

#include <nlohmann/json.hpp>

namespace cairn::pipeline {
namespace {

std::string ImageText(const MapRows& rows, int32_t image) {
  return image >= 0 ? rows.images[image].name : "-";
}

// Where what was at a change is now; null: nowhere.
const MapChange* Destination(const MapRows& rows, const MapChange& change) {
  return change.moved_to >= 0 ? &rows.findings.changes[change.moved_to] : nullptr;
}

std::string DestinationText(const MapRows& rows, const MapChange& change) {
  const MapChange* to = Destination(rows, change);
  if (to == nullptr) return "-";
  const Eigen::Vector3d place = rows.floor_from_world * to->position;
  return fmt::format("{:.2f}, {:.2f}", place.x(), place.y());
}

nlohmann::ordered_json DestinationJson(const MapRows& rows, const MapChange& change) {
  const MapChange* to = Destination(rows, change);
  if (to == nullptr) return {};
  const Eigen::Vector3d place = rows.floor_from_world * to->position;
  return {{"x_m", place.x()}, {"y_m", place.y()}, {"z_m", place.z()}, {"num_features", change.num_moved}};
}

nlohmann::ordered_json ImageJson(const MapRows& rows, int32_t image) {
  return image >= 0 ? nlohmann::ordered_json(rows.images[image].name) : nlohmann::ordered_json();
}

}  // namespace

std::vector<MapChange> ChangesSince(const MapRows& a, const MapRows& b) {
  std::vector<MapChange> changes;
  for (const MapChange& change : b.findings.changes) {
    const std::string& session = b.sessions[change.session];
    if (std::find(a.sessions.begin(), a.sessions.end(), session) == a.sessions.end())
      changes.push_back(change);
  }
  return changes;
}

std::string PlaceChangesText(const MapRows& rows, const std::vector<MapChange>& changes, int max_num_lines) {
  if (changes.empty()) return "";
  std::string text =
      fmt::format("  {:<16} {:>16} {:>8} {:>6} {:>6} {:>16}  {}\n", "first seen by", "place (floor)",
                  "radius", "gone", "new", "moved to", "image before -> after");
  for (size_t i = 0; i < changes.size() && i < static_cast<size_t>(max_num_lines); ++i) {
    const MapChange& change = changes[i];
    const Eigen::Vector3d place = rows.floor_from_world * change.position;
    text +=
        fmt::format("  {:<16} {:>16} {:>8.2f} {:>6} {:>6} {:>16}  {} -> {}\n", rows.sessions[change.session],
                    fmt::format("{:.2f}, {:.2f}", place.x(), place.y()), change.radius_m, change.num_vanished,
                    change.num_appeared, DestinationText(rows, change), ImageText(rows, change.image_before),
                    ImageText(rows, change.image_after));
  }
  if (changes.size() > static_cast<size_t>(max_num_lines))
    text += fmt::format("  and {} more (cairn inspect --json lists all)\n", changes.size() - max_num_lines);
  return text;
}

nlohmann::ordered_json PlaceChangesJson(const MapRows& rows, const std::vector<MapChange>& changes) {
  auto json = nlohmann::ordered_json::array();
  for (const MapChange& change : changes) {
    const Eigen::Vector3d place = rows.floor_from_world * change.position;
    json.push_back({{"session", rows.sessions[change.session]},
                    {"x_m", place.x()},
                    {"y_m", place.y()},
                    {"z_m", place.z()},
                    {"radius_m", change.radius_m},
                    {"num_vanished", change.num_vanished},
                    {"num_appeared", change.num_appeared},
                    {"moved_to", DestinationJson(rows, change)},
                    {"image_before", ImageJson(rows, change.image_before)},
                    {"image_after", ImageJson(rows, change.image_after)}});
  }
  return json;
}

}  // namespace cairn::pipeline
