#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/options/options.h"
#include "runtime/scans/range_scan.h"

namespace cairn {

// One beam of a laser.
struct Beam {
  Eigen::Vector2d direction;  // robot frame, of length 1
  double range_m = 0;
  bool met = false;  // something, at its range; otherwise it came at least so far

  // Where it ended, robot frame, metres.
  Eigen::Vector2d End() const { return range_m * direction; }
};

// A stretch of a wall as a laser saw it, robot frame, metres.  start -> end is counter-clockwise around the
// robot, so that it sees the left side.
struct ScanSegment {
  Eigen::Vector2d start, end;
  // Of the fitted line: its angle, and its offset at the middle of the points; the two do not correlate.
  double sigma_angle_rad = 0;
  double sigma_offset_m = 0;
  int num_points = 0;
  // Of the ends, along the line.
  double sigma_end_m = 0.02;

  double Length() const { return (end - start).norm(); }
  Eigen::Vector2d Middle() const { return 0.5 * (start + end); }
  double Angle() const { return std::atan2(end.y() - start.y(), end.x() - start.x()); }
};

struct ScanSegmentsOptions {
  // Beams of this range or more met nothing, metres.  REQUIRES: > 0
  double max_range_m = 20;
  // Least standard deviation of a range, metres.  REQUIRES: > 0
  double sigma_range_m = 0.01;
  // A point farther than this from the line of its stretch divides it, metres.  REQUIRES: > 0
  double split_m = 0.06;
  // Neighbouring points farther apart than this, and than max_gap_ratio times what a flat wall would give, do
  // not belong to one wall, metres.  REQUIRES: > 0
  double max_gap_m = 0.3;
  // Least number of points and least length of a segment.  REQUIRES: >= 2, >= 0
  int min_num_points = 6;
  double min_length_m = 0.3;
};
OptionTable DescribeOptions(ScanSegmentsOptions* options);

// Straight stretches of a scan by split-and-merge, each fitted by total least squares, in the order of the
// beams.  Empty for a scan without straight stretches.  Deterministic.  O(n log n) for n beams.
std::vector<ScanSegment> FindScanSegments(const RangeScan& scan, const ScanSegmentsOptions& options);

// The line through points that were seen counter-clockwise, with a standard deviation for each.
// REQUIRES: at least 2 points, not all the same.
ScanSegment FitSegment(const std::vector<Eigen::Vector2d>& points, double sigma_m);

}  // namespace cairn
