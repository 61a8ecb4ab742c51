#include "stages/filter_visibility/filter_visibility.h"

#include <algorithm>
#include <iterator>

#include "stages/filter_visibility/lattice_area.h"
#include "stages/filter_visibility/stations.h"

namespace cairn::filter_visibility {
namespace {

// The largest connected part of an area; among equals the one with the smallest station.
std::vector<StationIdx> LargestComponent(const std::vector<StationIdx>& area,
                                         const std::vector<std::vector<StationIdx>>& neighbours) {
  std::vector<StationIdx> largest, component;
  std::vector<bool> visited(area.size(), false);
  const auto position = [&](StationIdx station) {
    return static_cast<size_t>(std::lower_bound(area.begin(), area.end(), station) - area.begin());
  };
  for (size_t start = 0; start < area.size(); ++start) {
    if (visited[start]) continue;
    component = {area[start]};
    visited[start] = true;
    for (size_t i = 0; i < component.size(); ++i) {
      for (const StationIdx next : neighbours[component[i]]) {
        const size_t at = position(next);
        if (at == area.size() || area[at] != next || visited[at]) continue;
        visited[at] = true;
        component.push_back(next);
      }
    }
    if (component.size() > largest.size()) largest = component;
  }
  std::sort(largest.begin(), largest.end());
  return largest;
}

// The part of a class's area that stays, empty if none, with the reason.
std::vector<StationIdx> FilterLatticeArea(const std::vector<StationIdx>& area, const Stations& stations,
                                          const std::vector<std::vector<StationIdx>>& neighbours,
                                          const FilterVisibilityOptions& options, DropReason* reason) {
  // [Sala06 §VI-B] "visible from at least 16 poses"
  *reason = DropReason::kFewStations;
  if (static_cast<int>(area.size()) < options.min_num_stations) return {};
  // [Sala06 §VI-B] "few small holes"; how many and how small are options
  *reason = DropReason::kHoles;
  const std::vector<int> holes = HoleSizes(area, stations);
  if (static_cast<int>(holes.size()) > options.max_num_holes ||
      std::any_of(holes.begin(), holes.end(), [&](int size) { return size > options.max_hole_stations; })) {
    return {};
  }
  // [Sala06 §VI-B] "at least one connected component of at least 3 by 3 poses": a full block
  *reason = DropReason::kNoBlock;
  if (!HasBlock(area, stations, options.min_block_side)) return {};
  // [Sala06 §VI-B] of "the largest connected component" what has "a neighbor with at least 7 out of 8"
  *reason = DropReason::kTrimmedAway;
  return TrimArea(LargestComponent(area, neighbours), stations, options.min_num_neighbours);
}

std::vector<StationIdx> FilterDrivenArea(const std::vector<StationIdx>& area,
                                         const std::vector<std::vector<StationIdx>>& neighbours,
                                         const FilterVisibilityOptions& options, DropReason* reason) {
  *reason = DropReason::kFewStations;
  if (static_cast<int>(area.size()) < options.min_num_stations_driven) return {};
  *reason = DropReason::kScattered;
  std::vector<StationIdx> component = LargestComponent(area, neighbours);
  if (static_cast<int>(component.size()) < options.min_num_stations_driven) return {};
  return component;
}

// [Sala06 Def. 3.2] The visibility area of a class, {v : f in F_v}.
Result<std::vector<StationIdx>> AreaOfClass(const FeatureClass& feature_class, const Stations& stations) {
  std::vector<StationIdx> area;
  for (const Observation& observation : feature_class.observations) {
    const auto station = stations.station_of_image.find(observation.image_id);
    if (station == stations.station_of_image.end()) {
      return MakeError(ErrorCode::kCorrupt,
                       "class {} is observed in image {}, which the survey does not have",
                       feature_class.class_id, observation.image_id);
    }
    area.push_back(station->second);
  }
  std::sort(area.begin(), area.end());
  area.erase(std::unique(area.begin(), area.end()), area.end());
  return area;
}

}  // namespace

OptionTable DescribeOptions(FilterVisibilityOptions* o) {
  OptionTable table = {
      {.name = "survey",
       .value = &o->survey,
       .help = "how the survey was taken",
       .choices = {"auto", "lattice", "driven"}},
      {.name = "up",
       .value = &o->up,
       .help = "direction of up in the world frame as x,y,z, or auto: mean of the cameras' up"},
      {.name = "up_snap_deg",
       .value = &o->up_snap_deg,
       .help = "an automatic up within this angle of a world axis is replaced by that axis, degrees",
       .min = 0,
       .max = 45},
      {.name = "same_place_m",
       .value = &o->same_place_m,
       .help = "images this close were taken at one place (lattice)",
       .min = 1e-6,
       .max = 1e3},
      {.name = "cell_size_m",
       .value = &o->cell_size_m,
       .help = "edge of a station's cell (driven)",
       .min = 1e-3,
       .max = 1e6},
      {.name = "heading_bin_deg",
       .value = &o->heading_bin_deg,
       .help = "width of a station's heading (driven)",
       .min = 1,
       .max = 360},
      {.name = "min_num_stations",
       .value = &o->min_num_stations,
       .help = "fewest stations that see a class (lattice; Sala06: 16)",
       .min = 1},
      {.name = "max_hole_stations",
       .value = &o->max_hole_stations,
       .help = "most stations in a hole of a class's area (lattice)",
       .min = 0},
      {.name = "max_num_holes",
       .value = &o->max_num_holes,
       .help = "most holes of a class's area (lattice)",
       .min = 0},
      {.name = "min_block_side",
       .value = &o->min_block_side,
       .help = "an area must hold a full block of this many stations a side (lattice; Sala06: 3)",
       .min = 1,
       .max = 1000},
      {.name = "min_num_neighbours",
       .value = &o->min_num_neighbours,
       .help = "fewest of a station's 8 neighbours in the area for it and them to stay; 0 trims nothing "
               "(lattice; Sala06: 7)",
       .min = 0,
       .max = 8},
      {.name = "min_num_stations_driven",
       .value = &o->min_num_stations_driven,
       .help = "fewest connected stations that see a class (driven)",
       .min = 1},
  };
  AddCondition({"up", {"auto"}}, {"up_snap_deg"}, &table);
  AddCondition({"survey", {"auto", "lattice"}},
               {"same_place_m", "min_num_stations", "max_hole_stations", "max_num_holes", "min_block_side",
                "min_num_neighbours"},
               &table);
  AddCondition({"survey", {"auto", "driven"}}, {"cell_size_m", "heading_bin_deg", "min_num_stations_driven"},
               &table);
  return table;
}

Result<FilterVisibilityResult> FilterVisibility(const Classes& classes,
                                                const FilterVisibilityOptions& options) {
  FilterVisibilityOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_ASSIGN_OR_RETURN(Stations stations, FindStations(classes.images, options));
  const std::vector<std::vector<StationIdx>> neighbours = AdjacencyLists(stations.world);

  FilterVisibilityResult result{.world = stations.world, .is_lattice = stations.is_lattice};
  for (const FeatureClass& feature_class : classes.classes) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<StationIdx> area, AreaOfClass(feature_class, stations));
    DropReason reason{};
    std::vector<StationIdx> kept = stations.is_lattice
                                       ? FilterLatticeArea(area, stations, neighbours, options, &reason)
                                       : FilterDrivenArea(area, neighbours, options, &reason);
    if (kept.empty()) {
      ++result.dropped[DescribeDropReason(reason).name];
      result.dropped_items.push_back(
          {.reason = reason, .item_id = feature_class.class_id, .found = static_cast<int64_t>(area.size())});
      continue;
    }
    if (kept.size() < area.size()) {
      DroppedItem& item = result.dropped_items.emplace_back();
      item.reason = DropReason::kOutsideArea;
      item.item_id = feature_class.class_id;
      std::set_difference(area.begin(), area.end(), kept.begin(), kept.end(),
                          std::back_inserter(item.seen_at));
    }
    result.world.areas.push_back(std::move(kept));
    result.world.class_ids.push_back(feature_class.class_id);
  }
  return result;
}

std::string WhyNoFeature(const FilterVisibilityResult& result, size_t num_classes) {
  std::string reasons;
  for (const auto& [reason, count] : result.dropped)
    reasons += fmt::format("{}{} by {}", reasons.empty() ? "" : ", ", count, reason);
  return fmt::format(
      "none of {} classes is visible enough from the {} stations of a {} survey ({}): loosen the options of "
      "filter_visibility or survey more densely",
      num_classes, result.world.num_stations(), result.is_lattice ? "lattice" : "driven",
      reasons.empty() ? "there was none" : "dropped " + reasons);
}

}  // namespace cairn::filter_visibility
