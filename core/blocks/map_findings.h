#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/ids.h"

namespace cairn {

// The region of held-out images that were taken at no station of any region.
inline constexpr RegionIdx kOutsideRegions = -1;

// How the held-out images of one region fared.
struct RegionSelfTest {
  struct Errors {
    double median_m = 0;
    double median_deg = 0;
    double p90_m = 0;
    double p90_deg = 0;
    friend bool operator==(const Errors&, const Errors&) = default;
  };
  RegionIdx region = kOutsideRegions;
  int num_held_out = 0;
  int num_localized = 0;
  int num_gross_errors = 0;      // of those localized: farther off than the self-test's limits
  std::optional<Errors> errors;  // of those localized; empty where none was localized

  // REQUIRES: num_held_out > 0
  double LocalizedRatio() const { return static_cast<double>(num_localized) / num_held_out; }
  // Share of the fixes that are right; 1 where there are no fixes.
  double PrecisionRatio() const {
    return num_localized > 0 ? 1 - static_cast<double>(num_gross_errors) / num_localized : 1;
  }
  friend bool operator==(const RegionSelfTest&, const RegionSelfTest&) = default;
};

// What a stage dropped for one reason (core/world/drop_reason.h; schemas/drops.md), in the words of the
// program that wrote the map.
struct DropCount {
  int reason_id = 0;
  std::string stage;
  std::string kind;
  std::string name;
  std::string text;
  int64_t num_dropped = 0;
  std::vector<int32_t> at_stations;  // per station: how many of them there; empty: none at any
  friend bool operator==(const DropCount&, const DropCount&) = default;
};

// How well a region's places can be told from others.
struct RegionEntropy {
  RegionIdx region = 0;
  double entropy = 0;  // mean of the images' at its stations, nats
  friend bool operator==(const RegionEntropy&, const RegionEntropy&) = default;
};

// What the compilation found out about a map, for people who assess it (schemas/map_findings.sql).  A robot
// does not need it to localize.
struct MapFindings {
  std::vector<RegionSelfTest> self_test_regions;  // those with held-out images, ascending region
  std::vector<RegionEntropy> region_entropies;    // those with images of the appearance graph, ascending
  std::vector<DropCount> drops;                   // reasons that occurred, ascending
  friend bool operator==(const MapFindings&, const MapFindings&) = default;
};

// Errors: InvalidArgument, naming the row: a row out of order, of a region that does not exist, or with
// impossible numbers.
Status CheckMapFindings(const MapFindings& findings, size_t num_regions, size_t num_stations);

}  // namespace cairn
