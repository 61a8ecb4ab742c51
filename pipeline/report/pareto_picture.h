#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/explain/pareto_points.h"

namespace cairn::pipeline {

// Another program's map of the same place, to compare with.
struct ParetoPeer {
  std::string name;
  double num_bytes = 0;
  double localized_ratio = 0;
  double median_error_m = 0;
};

// Part of the held-out images localized, and the median error, over the map's bytes (logarithmic).
std::string ParetoSvg(const std::string& map_name, const std::vector<ParetoPoint>& points,
                      const std::optional<ParetoPeer>& peer);

}  // namespace cairn::pipeline
