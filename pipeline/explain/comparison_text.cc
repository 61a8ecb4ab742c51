// Comparisons of maps for people and for programs.
#include <algorithm>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include <toml++/toml.h>
#include <nlohmann/json.hpp>

#include "core/options/toml_options.h"
#include "pipeline/explain/compare_maps.h"
#include "pipeline/explain/place_changes.h"
#include "pipeline/explain/station_text.h"

namespace cairn::pipeline {
namespace {

// "decompose_regions.k" -> "40" of all stages.
std::map<std::string, std::string> FlatOptions(const MapRows& rows) {
  std::map<std::string, std::string> flat;
  for (const auto& [stage, text] : rows.stage_options) {
    const Result<toml::table> options = ParseToml(text, stage);
    if (!options.ok()) {
      flat[fmt::format("[{}]", stage)] = text;  // of a program that wrote it otherwise
      continue;
    }
    for (const auto& [key, value] : *options) {
      std::ostringstream printed;
      value.visit([&](const auto& node) { printed << node; });
      flat[fmt::format("[{}] {}", stage, key.str())] = printed.str();
    }
  }
  return flat;
}

// Per key that differs, what A and B have; empty: not there.
template <typename Value>
std::map<std::string, std::pair<std::optional<Value>, std::optional<Value>>> Differences(
    const std::map<std::string, Value>& a, const std::map<std::string, Value>& b) {
  std::map<std::string, std::pair<std::optional<Value>, std::optional<Value>>> differences;
  for (const auto& [key, value] : a) differences[key].first = value;
  for (const auto& [key, value] : b) differences[key].second = value;
  std::erase_if(differences, [](const auto& entry) { return entry.second.first == entry.second.second; });
  return differences;
}

int NumUncovered(const MapRows& rows) {
  return static_cast<int>(std::count_if(rows.stations.begin(), rows.stations.end(),
                                        [](const MapStation& station) { return !station.is_covered; }));
}

std::vector<std::pair<std::string, std::pair<int64_t, int64_t>>> Counts(const MapRows& a, const MapRows& b,
                                                                        int64_t bytes_a, int64_t bytes_b) {
  const auto pair = [](auto left, auto right) {
    return std::pair(static_cast<int64_t>(left), static_cast<int64_t>(right));
  };
  return {{"bytes", pair(bytes_a, bytes_b)},
          {"landmarks", pair(a.landmarks.size(), b.landmarks.size())},
          {"regions", pair(a.regions.size(), b.regions.size())},
          {"stations", pair(a.stations.size(), b.stations.size())},
          {"stations not covered", pair(NumUncovered(a), NumUncovered(b))},
          {"survey images", pair(a.images.size(), b.images.size())},
          {"k", pair(a.k, b.k)}};
}

std::string RegionsText(const MapRows& a, const MapRows& b, const MapComparison& comparison,
                        int max_num_lines) {
  int num_same = 0, num_changed = 0, num_of_a = 0, num_of_b = 0;
  for (const MapComparison::RegionChange& change : comparison.regions) {
    if (change.same) {
      ++num_same;
    } else if (change.in_b < 0) {
      ++num_of_a;
    } else if (change.in_a < 0) {
      ++num_of_b;
    } else {
      ++num_changed;
    }
  }
  std::string text = fmt::format("\nregions: {} the same, {} changed, {} of A alone, {} of B alone\n",
                                 num_same, num_changed, num_of_a, num_of_b);
  int num_lines = 0;
  for (const MapComparison::RegionChange& change : comparison.regions) {
    if (change.same || num_lines++ >= max_num_lines) continue;
    const auto size = [](const MapRegion& region) {
      return fmt::format("{} stations, {} landmarks", region.stations.size(), region.landmarks.size());
    };
    if (change.in_b < 0) {
      text += fmt::format("  A's {}: {}\n", change.in_a, size(a.regions[change.in_a]));
    } else if (change.in_a < 0) {
      text += fmt::format("  B's {}: {}\n", change.in_b, size(b.regions[change.in_b]));
    } else {
      text += fmt::format("  {} -> {}: {} -> {}; shared {} and {}\n", change.in_a, change.in_b,
                          size(a.regions[change.in_a]), size(b.regions[change.in_b]),
                          change.num_shared_stations, change.num_shared_landmarks);
    }
  }
  if (num_lines > max_num_lines)
    text += fmt::format("  and {} more (--json lists all)\n", num_lines - max_num_lines);
  return text;
}

std::string StationsText(const MapRows& b, const std::vector<StationIdx>& stations, const char* what,
                         int max_num_lines) {
  std::string text;
  for (size_t i = 0; i < stations.size() && i < static_cast<size_t>(max_num_lines); ++i)
    text += fmt::format("  {} {}\n", what, StationText(b, stations[i]));
  if (stations.size() > static_cast<size_t>(max_num_lines))
    text += fmt::format("  and {} more (--json lists all)\n", stations.size() - max_num_lines);
  return text;
}

std::string NamesText(const std::vector<std::string>& names, const char* which, int max_num_lines) {
  if (names.empty()) return "";
  std::string text = fmt::format("  {} of {} alone:", names.size(), which);
  for (size_t i = 0; i < names.size() && i < static_cast<size_t>(max_num_lines); ++i) text += " " + names[i];
  return text + (names.size() > static_cast<size_t>(max_num_lines) ? " ...\n" : "\n");
}

}  // namespace

std::string ComparisonText(const MapRows& a, const MapRows& b, int64_t bytes_a, int64_t bytes_b,
                           const MapComparison& comparison, int max_num_lines) {
  std::string text = fmt::format("{:<24} {:>14} {:>14} {:>14}\n", "", "A", "B", "B - A");
  for (const auto& [name, counts] : Counts(a, b, bytes_a, bytes_b)) {
    text += fmt::format("{:<24} {:>14} {:>14} {:>+14}\n", name, counts.first, counts.second,
                        counts.second - counts.first);
  }
  const auto self_test = Differences(a.self_test, b.self_test);
  if (!self_test.empty()) text += "\nself-test (figures that differ)\n";
  for (const auto& [figure, values] : self_test) {
    const auto value = [](const std::optional<double>& number) {
      return number ? fmt::format("{:.4g}", *number) : "-";
    };
    text += fmt::format("  {:<30} {:>10} {:>10}\n", figure, value(values.first), value(values.second));
  }
  const auto options = Differences(FlatOptions(a), FlatOptions(b));
  if (!options.empty()) text += "\noptions that differ\n";
  for (const auto& [key, values] : options) {
    text += fmt::format("  {:<46} {} -> {}\n", key, values.first.value_or("(not there)"),
                        values.second.value_or("(not there)"));
  }
  text += fmt::format("\nlandmarks: {} of both", comparison.num_landmarks_shared);
  if (comparison.num_landmarks_shared > 0) {
    text += fmt::format(" (moved by {:.1f} mm on the median, {:.1f} mm at most)",
                        1e3 * comparison.median_move_m, 1e3 * comparison.max_move_m);
  }
  text += fmt::format(", {} of A alone, {} of B alone\n",
                      static_cast<int64_t>(a.landmarks.size()) - comparison.num_landmarks_shared,
                      static_cast<int64_t>(b.landmarks.size()) - comparison.num_landmarks_shared);
  text += RegionsText(a, b, comparison, max_num_lines);
  text += fmt::format("\ncoverage: {} stations lost it, {} gained it\n", comparison.coverage_lost.size(),
                      comparison.coverage_gained.size());
  text += StationsText(b, comparison.coverage_lost, "lost  ", max_num_lines);
  text += StationsText(b, comparison.coverage_gained, "gained", max_num_lines);
  if (const std::vector<MapChange> changes = ChangesSince(a, b); !changes.empty()) {
    text += fmt::format("\nplaces that changed: {} that A does not know\n", changes.size());
    text += PlaceChangesText(b, changes, max_num_lines);
  }
  if (!comparison.images_only_in_a.empty() || !comparison.images_only_in_b.empty())
    text += "\nsurvey images\n";
  text += NamesText(comparison.images_only_in_a, "A", max_num_lines);
  text += NamesText(comparison.images_only_in_b, "B", max_num_lines);
  return text;
}

nlohmann::ordered_json ComparisonJson(const MapRows& a, const MapRows& b, int64_t bytes_a, int64_t bytes_b,
                                      const MapComparison& comparison) {
  nlohmann::ordered_json json = {{"names", {a.name, b.name}}};
  for (const auto& [name, counts] : Counts(a, b, bytes_a, bytes_b)) {
    std::string key = name;
    std::replace(key.begin(), key.end(), ' ', '_');
    json[key] = {counts.first, counts.second};
  }
  const auto add = [&](const char* key, const auto& differences) {
    json[key] = nlohmann::ordered_json::object();
    for (const auto& [name, values] : differences) {
      json[key][name] = {nullptr, nullptr};
      if (values.first) json[key][name][0] = *values.first;
      if (values.second) json[key][name][1] = *values.second;
    }
  };
  add("self_test", Differences(a.self_test, b.self_test));
  add("options", Differences(FlatOptions(a), FlatOptions(b)));
  json["num_landmarks_shared"] = comparison.num_landmarks_shared;
  json["median_move_m"] = comparison.median_move_m;
  json["max_move_m"] = comparison.max_move_m;
  json["num_regions_changed"] = NumChangedRegions(comparison);
  json["region_changes"] = nlohmann::ordered_json::array();
  for (const MapComparison::RegionChange& change : comparison.regions) {
    if (change.same) continue;
    json["region_changes"].push_back({{"in_a", change.in_a},
                                      {"in_b", change.in_b},
                                      {"num_shared_stations", change.num_shared_stations},
                                      {"num_shared_landmarks", change.num_shared_landmarks}});
  }
  json["coverage_lost"] = comparison.coverage_lost;
  json["coverage_gained"] = comparison.coverage_gained;
  json["changed_places"] = PlaceChangesJson(b, ChangesSince(a, b));
  json["images_only_in_a"] = comparison.images_only_in_a;
  json["images_only_in_b"] = comparison.images_only_in_b;
  return json;
}

}  // namespace cairn::pipeline
