#include "stages/check_map/region_figures.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "core/base/quantiles.h"
#include "core/geometry/floor_pose.h"

namespace cairn::check_map {
namespace {

RegionSelfTest Summarize(RegionIdx region, const std::vector<const HeldOutResult*>& results,
                         const CheckMapOptions& options) {
  RegionSelfTest row{.region = region, .num_held_out = static_cast<int>(results.size())};
  std::vector<double> errors_m, errors_deg;
  for (const HeldOutResult* result : results) {
    if (!result->has_fix()) continue;
    errors_m.push_back(result->error_m);
    errors_deg.push_back(result->error_deg);
    row.num_gross_errors += IsGrossError(*result, options) ? 1 : 0;
  }
  row.num_localized = static_cast<int>(errors_m.size());
  if (row.num_localized > 0) {
    row.errors = {.median_m = Quantile(errors_m, 0.5),
                  .median_deg = Quantile(errors_deg, 0.5),
                  .p90_m = Quantile(errors_m, 0.9),
                  .p90_deg = Quantile(errors_deg, 0.9)};
  }
  return row;
}

}  // namespace

double StationSpacingM(const std::vector<MapStation>& stations) {
  std::vector<Eigen::Vector2d> places;
  for (const MapStation& station : stations) places.push_back(station.position);
  std::sort(places.begin(), places.end(),
            [](const auto& a, const auto& b) { return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y()); });
  std::vector<double> distances;
  for (auto place = places.begin(); place != places.end(); ++place) {
    double nearest = std::numeric_limits<double>::infinity();
    // Whether the other, and all beyond it, are too far away along x.
    const auto is_beyond = [&](const Eigen::Vector2d& other) {
      const double distance = (other - *place).norm();
      if (distance > 0) nearest = std::min(nearest, distance);
      return std::abs(other.x() - place->x()) > nearest;
    };
    (void)std::find_if(place, places.end(), is_beyond);
    (void)std::find_if(std::make_reverse_iterator(place), places.rend(), is_beyond);
    if (std::isfinite(nearest)) distances.push_back(nearest);
  }
  return distances.empty() ? 0 : Quantile(distances, 0.5);
}

std::optional<StationIdx> StationOf(const Pose& cam_from_world, double spacing_m, const MapRows& rows,
                                    const CheckMapOptions& options) {
  const FloorPose camera = FloorPoseOf(rows.camera_from_given * cam_from_world, rows.floor_from_world);
  std::optional<std::tuple<double, double, StationIdx>> best;
  for (size_t i = 0; i < rows.stations.size(); ++i) {
    const MapStation& station = rows.stations[i];
    const double turn_deg =
        station.heading_deg ? AngleBetweenDeg(*station.heading_deg, camera.heading_deg) : 0;
    if (turn_deg > options.max_station_heading_deg) continue;
    const std::tuple candidate((station.position - camera.position).norm(), turn_deg,
                               static_cast<StationIdx>(i));
    if (!best || candidate < *best) best = candidate;
  }
  if (!best) return std::nullopt;
  const double distance = std::get<0>(*best);
  if (spacing_m > 0 && distance > options.max_station_distance_ratio * spacing_m) return std::nullopt;
  return std::get<2>(*best);
}

void FindStations(const MapRows& rows, const CheckMapOptions& options, std::vector<HeldOutResult>* results) {
  const double spacing_m = StationSpacingM(rows.stations);
  for (HeldOutResult& result : *results) {
    if (result.true_cam_from_world)
      result.station = StationOf(*result.true_cam_from_world, spacing_m, rows, options);
  }
}

std::vector<RegionSelfTest> SummarizeRegions(const MapRows& rows, const std::vector<HeldOutResult>& results,
                                             const CheckMapOptions& options) {
  std::map<RegionIdx, std::vector<const HeldOutResult*>> of_region;
  for (const HeldOutResult& result : results) {
    if (!result.true_cam_from_world) continue;
    bool is_inside = false;
    for (size_t region = 0; result.station && region < rows.regions.size(); ++region) {
      const std::vector<StationIdx>& stations = rows.regions[region].stations;
      if (!std::binary_search(stations.begin(), stations.end(), *result.station)) continue;
      of_region[static_cast<RegionIdx>(region)].push_back(&result);
      is_inside = true;
    }
    if (!is_inside) of_region[kOutsideRegions].push_back(&result);
  }
  std::vector<RegionSelfTest> summary;
  for (const auto& [region, of_it] : of_region) summary.push_back(Summarize(region, of_it, options));
  return summary;
}

}  // namespace cairn::check_map
