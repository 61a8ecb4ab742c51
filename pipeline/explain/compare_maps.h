#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"

namespace cairn::pipeline {

// What changed between two maps of one place, A and B, whose world frames are the same.

struct CompareMapsOptions {
  // Landmarks farther apart than this are not the same scene feature, m.
  double max_landmark_distance_m = 0.05;
  // Nor are landmarks whose descriptors differ by more than this angle, degrees: the same feature seen again
  // differs by 15 to 30, another one by 50 to 90.
  double max_descriptor_angle_deg = 40;
  // Stations farther apart than this, m, or with a larger difference of headings, degrees, are not the same.
  double max_station_distance_m = 0.1;
  double max_heading_difference_deg = 10;
  // Regions that share less than this part of the stations that either has are not the same.
  double min_region_overlap_ratio = 0.5;
};

struct MapComparison {
  // Per landmark of A, the same of B; -1: gone.  Mutually nearest in descriptors.
  std::vector<LandmarkIdx> landmark_in_b;
  int64_t num_landmarks_shared = 0;
  // Of the shared ones; 0 where there is none.
  double median_move_m = 0;
  double max_move_m = 0;

  // Per station of A, the same of B; -1: gone.  Mutually nearest.
  std::vector<StationIdx> station_in_b;
  std::vector<StationIdx> coverage_lost;    // stations of B that were covered in A and are not, ascending
  std::vector<StationIdx> coverage_gained;  // the other way round

  struct RegionChange {
    RegionIdx in_a = -1;  // -1: of B alone
    RegionIdx in_b = -1;  // -1: of A alone
    int num_shared_stations = 0;
    int num_shared_landmarks = 0;
    bool same = false;  // the same stations and the same landmarks
  };
  // All regions of both: those of B ascending, then those of A without one in B.
  std::vector<RegionChange> regions;

  std::vector<std::string> images_only_in_a, images_only_in_b;  // names, ascending
};

// O(n log n) for landmarks that are not closer together than the distance.
MapComparison CompareMaps(const MapRows& a, const MapRows& b, const CompareMapsOptions& options = {});

// The number of regions of B that are not the same in A, and of those of A without one in B.
int NumChangedRegions(const MapComparison& comparison);

// For people; at most `max_num_lines` stations and regions each.  `bytes`: of the files.
std::string ComparisonText(const MapRows& a, const MapRows& b, int64_t bytes_a, int64_t bytes_b,
                           const MapComparison& comparison, int max_num_lines);
// For programs: all of it.
nlohmann::ordered_json ComparisonJson(const MapRows& a, const MapRows& b, int64_t bytes_a, int64_t bytes_b,
                                      const MapComparison& comparison);

}  // namespace cairn::pipeline
