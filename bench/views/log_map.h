#pragma once

#include <vector>

#include "runtime/scans/carmen_log.h"
#include "runtime/scans/scan_segments.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn {

// Walls that the even scans of a log saw from its poses: those of three scans and 0.4 m at least.
decompose_views::InputPlan MapOfEverySecond(const std::vector<RangeScan>& scans,
                                            const ScanSegmentsOptions& options);

}  // namespace cairn
