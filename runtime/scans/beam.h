#pragma once

#include <vector>

#include <Eigen/Core>

#include "runtime/scans/range_scan.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// The beams of a scan; those of `max_range_m` or more, or of the laser's own largest range, met nothing.
// Those without a range (0, less, NaN) are left out.
std::vector<Beam> BeamsOf(const RangeScan& scan, double max_range_m);

// Beams to points of segments, one a degree and five a segment at least: what is known of a scan of which
// only the straight stretches are.
std::vector<Beam> BeamsTo(const std::vector<ScanSegment>& segments);

}  // namespace cairn
