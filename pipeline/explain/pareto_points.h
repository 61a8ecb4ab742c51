#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace cairn::pipeline {

// A map of one survey at one size, and how it fared.
struct ParetoPoint {
  int64_t max_bytes = 0;  // required; 0: every class
  int64_t num_bytes = 0;  // of the sealed map
  int64_t num_landmarks = 0;
  int descriptor_bits = 0;
  int min_common_landmarks = 0;  // of any region
  int num_stations_below_k = 0;
  // Of held-out images.
  int num_held_out = 0;
  double localized_ratio = 0;
  double within_10cm_5deg_ratio = 0;
  double precision_ratio = 1;
  std::optional<double> median_error_m, median_error_deg;  // where any was localized
};

// One line per map, the largest first; a head line.
std::string ParetoCsv(const std::vector<ParetoPoint>& points);
// Errors: Corrupt, naming the line: of another form than ParetoCsv's.
Result<std::vector<ParetoPoint>> ParseParetoCsv(const std::string& csv, const std::string& path);
// For people.
std::string ParetoText(const std::vector<ParetoPoint>& points);

}  // namespace cairn::pipeline
