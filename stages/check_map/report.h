#pragma once

#include <optional>
#include <string>

#include "core/map_rows.h"
#include "stages/check_map/check_map.h"

namespace cairn {

// What check-map prints: the figures of the held-out images and, if other places were tried, of the images
// there.
struct PrintedReport {
  const MapRows* rows = nullptr;
  int64_t map_bytes = 0;
  const CheckMapReport* held_out = nullptr;
  const CheckMapReport* foreign = nullptr;  // may be null
};

// For people, a figure per line.
std::string ReportText(const PrintedReport& report);
// One JSON object: the same figures, and every image with its fix or reason.
std::string ReportJson(const PrintedReport& report);

}  // namespace cairn
