#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "runtime/scans/range_scan.h"

namespace cairn {

// Reads scans from messages of ROS as JSON, one a line, in the order in which they came:
//   sensor_msgs/LaserScan     angle_min, angle_increment, range_max, ranges; header.stamp where it matters
//   nav_msgs/Odometry         pose.pose of the robot's base (and a twist, which other poses lack); the scans
//                             between two have their odometry
// The laser is taken to be at the base, level, not upside down.  A range that is null or NaN, or below
// range_min, is left out; one of range_max or more, or Infinity (REP 117), met nothing.  Other messages
// (lines with neither `ranges` nor `pose`) are left out.  Scans have no pose. Errors: Corrupt (a line that is
// not JSON, or lacks a number), NoData (no scan).
Result<std::vector<RangeScan>> ParseLaserJson(const std::string& text, const std::string& what);

}  // namespace cairn
