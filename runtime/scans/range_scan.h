#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"

namespace cairn {

// Most beams of a scan that is read.
inline constexpr int kMaxBeams = 100000;

// One turn of a laser scanner that stands level.
struct RangeScan {
  double first_angle_rad = 0;  // of the first beam, from the laser's x, counter-clockwise
  double step_rad = 0;         // from beam to beam
  // Of each beam, where they do not follow each other in equal steps; empty: they do.
  std::vector<double> angles_rad;
  std::vector<double> ranges_m;
  double max_range_m = std::numeric_limits<double>::infinity();  // beams of this range met nothing
  PlanarPose pose;                                               // of the laser, from the log
  double time_s = 0;                                             // of the log
  // Of the laser by the robot's wheels alone, in a frame of theirs that drifts.
  std::optional<PlanarPose> odometry;

  double AngleOf(size_t beam) const {
    return angles_rad.empty() ? first_angle_rad + static_cast<double>(beam) * step_rad : angles_rad[beam];
  }
};

// For a scan of a caller's numbers.  Ranges may be anything: those that are not more than 0 are left out.
// Errors: InvalidArgument (no beams or more than kMaxBeams, angles that are not one for each range or not
// finite, beams that all look one way or sweep more than a turn, as degrees taken for radians do, a largest
// range that is not more than 0).
Status CheckRangeScan(const RangeScan& scan);

}  // namespace cairn
