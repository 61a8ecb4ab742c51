#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_findings.h"
#include "core/blocks/map_rows.h"
#include "stages/check_map/check_map.h"

namespace cairn::check_map {

// What check-map prints: the figures of the held-out images and, if other places were tried, of the
// images there.
struct PrintedReport {
  const MapRows* rows = nullptr;
  int64_t map_bytes = 0;
  const CheckMapReport* held_out = nullptr;
  const CheckMapReport* foreign = nullptr;  // may be null
  const CheckMapOptions* options = nullptr;
};

// For people, a figure per line.
std::string ReportText(const PrintedReport& report);
// One JSON object: the same figures, and every image with its fix or reason.  Without times: same images,
// same map, same bytes.
std::string ReportJson(const PrintedReport& report, bool with_times);

// For people, a line per region: those with the fewest images localized right first, at most `max_num_lines`.
// Lengths in the unit of the map's frame.  Empty where no region has held-out images.
std::string SelfTestRegionsText(const std::vector<RegionSelfTest>& regions, int max_num_lines,
                                const CaptureFrame& frame);
// For programs: a list, ascending; "region" is null for images outside.
nlohmann::ordered_json SelfTestRegionsJson(const std::vector<RegionSelfTest>& regions);

}  // namespace cairn::check_map
