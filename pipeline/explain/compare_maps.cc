#include "pipeline/explain/compare_maps.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include "core/base/quantiles.h"
#include "core/features/descriptor_distance.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "core/structure/points.h"

namespace cairn::pipeline {
namespace {

// Per point of A the point of B, where each is the other's best by cost(a, b, distance); a negative cost: not
// the same.
template <typename Cost>
std::vector<int32_t> MutuallyBest(const std::vector<Eigen::Vector3d>& a,
                                  const std::vector<Eigen::Vector3d>& b, double max_distance,
                                  const Cost& cost) {
  std::vector<int32_t> best_of_a(a.size(), -1), best_of_b(b.size(), -1);
  std::vector<double> cost_of_a(a.size()), cost_of_b(b.size());
  const PointGrid grid(b, max_distance);
  for (size_t i = 0; i < a.size(); ++i) {
    grid.ForNear(a[i], [&](int j, double distance) {
      const double found = cost(i, j, distance);
      if (found < 0) return;
      if (best_of_a[i] < 0 || found < cost_of_a[i]) {
        best_of_a[i] = j;
        cost_of_a[i] = found;
      }
      if (best_of_b[j] < 0 || found < cost_of_b[j]) {
        best_of_b[j] = static_cast<int32_t>(i);
        cost_of_b[j] = found;
      }
    });
  }
  for (size_t i = 0; i < a.size(); ++i) {
    if (best_of_a[i] >= 0 && best_of_b[best_of_a[i]] != static_cast<int32_t>(i)) best_of_a[i] = -1;
  }
  return best_of_a;
}

std::vector<Eigen::Vector3d> LandmarkPlaces(const MapRows& rows) {
  std::vector<Eigen::Vector3d> places;
  for (const MapLandmark& landmark : rows.landmarks) places.push_back(landmark.position);
  return places;
}

std::vector<Eigen::Vector3d> StationPlaces(const MapRows& rows) {
  std::vector<Eigen::Vector3d> places;
  for (const MapStation& station : rows.stations)
    places.emplace_back(station.position.x(), station.position.y(), 0);
  return places;
}

// Between two descriptors, whatever their lengths: rounding to few levels changes those.
double AngleRad(const uint8_t* a, const uint8_t* b, const DescriptorSpace& space) {
  const double lengths =
      std::sqrt(static_cast<double>(DescriptorDot(a, a, space)) * DescriptorDot(b, b, space));
  return lengths > 0 ? std::acos(std::clamp(DescriptorDot(a, b, space) / lengths, 0.0, 1.0)) : 0;
}

std::vector<int32_t> MatchLandmarks(const MapRows& a, const MapRows& b, const CompareMapsOptions& options) {
  const double max_angle = RadFromDeg(options.max_descriptor_angle_deg);
  // Landmarks with descriptors of another kind are others.
  if (a.descriptor_kind.space() != b.descriptor_kind.space())
    return std::vector<int32_t>(a.landmarks.size(), -1);
  return MutuallyBest(LandmarkPlaces(a), LandmarkPlaces(b), options.max_landmark_distance_m,
                      [&](size_t i, int j, double) {
                        const double angle = AngleRad(a.descriptors.row(static_cast<Eigen::Index>(i)).data(),
                                                      b.descriptors.row(j).data(), a.descriptor_kind.space());
                        return angle <= max_angle ? angle : -1.0;
                      });
}

std::vector<int32_t> MatchStations(const MapRows& a, const MapRows& b, const CompareMapsOptions& options) {
  return MutuallyBest(
      StationPlaces(a), StationPlaces(b), options.max_station_distance_m,
      [&](size_t i, int j, double distance) {
        const auto& heading_a = a.stations[i].heading_deg;
        const auto& heading_b = b.stations[j].heading_deg;
        if (heading_a.has_value() != heading_b.has_value()) return -1.0;
        if (heading_a && AngleBetweenDeg(*heading_a, *heading_b) > options.max_heading_difference_deg) {
          return -1.0;
        }
        return distance;
      });
}

// How many of A's elements are B's.
template <typename Index>
int NumShared(const std::vector<Index>& of_a, const std::vector<Index>& in_b,
              const std::vector<Index>& of_b) {
  int num_shared = 0;
  for (const Index element : of_a) {
    if (in_b[element] >= 0 && std::binary_search(of_b.begin(), of_b.end(), in_b[element])) ++num_shared;
  }
  return num_shared;
}

// Per region of B the region of A that shares most of the stations that either has; no region of A twice.
void MatchRegions(const MapRows& a, const MapRows& b, double min_overlap, MapComparison* comparison) {
  struct Overlap {
    double ratio;
    RegionIdx in_a, in_b;
    int num_shared;
  };
  std::vector<StationIdx> station_in_a(b.stations.size(), -1);
  for (size_t i = 0; i < comparison->station_in_b.size(); ++i) {
    if (comparison->station_in_b[i] >= 0)
      station_in_a[comparison->station_in_b[i]] = static_cast<StationIdx>(i);
  }
  std::vector<std::vector<RegionIdx>> regions_at(a.stations.size());
  for (size_t region = 0; region < a.regions.size(); ++region) {
    for (const StationIdx station : a.regions[region].stations)
      regions_at[station].push_back(static_cast<RegionIdx>(region));
  }
  std::vector<Overlap> overlaps;
  for (size_t region = 0; region < b.regions.size(); ++region) {
    std::map<RegionIdx, int> num_shared;
    for (const StationIdx station : b.regions[region].stations) {
      if (station_in_a[station] < 0) continue;
      for (const RegionIdx in_a : regions_at[station_in_a[station]]) ++num_shared[in_a];
    }
    for (const auto& [in_a, num] : num_shared) {
      const auto either =
          static_cast<double>(a.regions[in_a].stations.size() + b.regions[region].stations.size()) - num;
      if (num >= min_overlap * either)
        overlaps.push_back({num / either, in_a, static_cast<RegionIdx>(region), num});
    }
  }
  std::stable_sort(overlaps.begin(), overlaps.end(),
                   [](const Overlap& left, const Overlap& right) { return left.ratio > right.ratio; });
  std::vector<char> taken(a.regions.size(), 0);
  comparison->regions.resize(b.regions.size());
  for (size_t region = 0; region < b.regions.size(); ++region)
    comparison->regions[region].in_b = static_cast<RegionIdx>(region);
  for (const Overlap& overlap : overlaps) {
    MapComparison::RegionChange& change = comparison->regions[overlap.in_b];
    if (change.in_a >= 0 || taken[overlap.in_a] != 0) continue;
    taken[overlap.in_a] = 1;
    change.in_a = overlap.in_a;
    change.num_shared_stations = overlap.num_shared;
    const MapRegion& of_a = a.regions[overlap.in_a];
    const MapRegion& of_b = b.regions[overlap.in_b];
    change.num_shared_landmarks = NumShared(of_a.landmarks, comparison->landmark_in_b, of_b.landmarks);
    const auto all_of = [](int num_shared, size_t num_a, size_t num_b) {
      return static_cast<size_t>(num_shared) == num_a && num_a == num_b;
    };
    change.same = all_of(overlap.num_shared, of_a.stations.size(), of_b.stations.size()) &&
                  all_of(change.num_shared_landmarks, of_a.landmarks.size(), of_b.landmarks.size());
  }
  for (size_t region = 0; region < a.regions.size(); ++region) {
    if (taken[region] == 0) comparison->regions.push_back({.in_a = static_cast<RegionIdx>(region)});
  }
}

// Names of images of `rows` that `other` lacks, ascending.
std::vector<std::string> ImagesOnlyIn(const MapRows& rows, const MapRows& other) {
  const auto names = [](const MapRows& map) {
    std::set<std::string> set;
    for (const MapImage& image : map.images) set.insert(image.name);
    return set;
  };
  const std::set<std::string> mine = names(rows), others = names(other);
  std::vector<std::string> only;
  std::set_difference(mine.begin(), mine.end(), others.begin(), others.end(), std::back_inserter(only));
  return only;
}

}  // namespace

MapComparison CompareMaps(const MapRows& a, const MapRows& b, const CompareMapsOptions& options) {
  MapComparison comparison;
  comparison.landmark_in_b = MatchLandmarks(a, b, options);
  std::vector<double> moves;
  for (size_t i = 0; i < a.landmarks.size(); ++i) {
    const LandmarkIdx in_b = comparison.landmark_in_b[i];
    if (in_b >= 0) moves.push_back((a.landmarks[i].position - b.landmarks[in_b].position).norm());
  }
  comparison.num_landmarks_shared = static_cast<int64_t>(moves.size());
  if (!moves.empty()) {
    comparison.median_move_m = UpperMedian(moves);
    comparison.max_move_m = *std::max_element(moves.begin(), moves.end());
  }
  comparison.station_in_b = MatchStations(a, b, options);
  for (size_t i = 0; i < a.stations.size(); ++i) {
    const StationIdx in_b = comparison.station_in_b[i];
    if (in_b < 0 || a.stations[i].is_covered == b.stations[in_b].is_covered) continue;
    (a.stations[i].is_covered ? comparison.coverage_lost : comparison.coverage_gained).push_back(in_b);
  }
  std::sort(comparison.coverage_lost.begin(), comparison.coverage_lost.end());
  std::sort(comparison.coverage_gained.begin(), comparison.coverage_gained.end());
  MatchRegions(a, b, options.min_region_overlap_ratio, &comparison);
  comparison.images_only_in_a = ImagesOnlyIn(a, b);
  comparison.images_only_in_b = ImagesOnlyIn(b, a);
  return comparison;
}

int NumChangedRegions(const MapComparison& comparison) {
  return static_cast<int>(std::count_if(comparison.regions.begin(), comparison.regions.end(),
                                        [](const auto& change) { return !change.same; }));
}

}  // namespace cairn::pipeline
