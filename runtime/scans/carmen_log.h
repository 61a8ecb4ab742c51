#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "runtime/scans/range_scan.h"

namespace cairn {

// Reads the scans of a Carmen log:
//   FLASER n r_1 ... r_n x y theta odom_x odom_y odom_theta ipc_timestamp host logger_timestamp
// n beams over 180 degrees, the first at -90 (n even: steps of 180 / n; odd: of 180 / (n - 1)), and
//   ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range ...
// of any angles.  The largest range of a log is the laser's own where it occurs often.  Odometry is that of
// FLASER lines where in some of them it differs from the pose; else, as where poses were corrected later,
// what the ODOM lines around a scan say at its time; without any the poses themselves:
//   ODOM x y theta tv rv accel ipc_timestamp host logger_timestamp
// (after others one with a time of 0 states a corrected pose, from which the next lines go on.)  Wheels move
// a laser that stands `PARAM robot_frontlaser_offset` metres ahead of their axle.  Other messages are left
// out.  Errors: NotFound, Corrupt (a line that is cut short or has an invalid number; gzip), NoData (no
// scan).
Result<std::vector<RangeScan>> ReadCarmenLog(const std::string& path);
Result<std::vector<RangeScan>> ParseCarmenLog(const std::string& text, const std::string& what);

}  // namespace cairn
