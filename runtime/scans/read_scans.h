#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

// What one scan shows.
struct ScanView {
  std::vector<ScanSegment> segments;
  std::vector<Beam> beams;             // of a scan that is given by its segments: beams to these
  std::optional<PlanarPose> odometry;  // RangeScan::odometry
};

// What a scan of a log shows.
ScanView ViewOf(const RangeScan& scan, const ScanSegmentsOptions& options);

// Reads scans: a Carmen log (a line begins with FLASER or ROBOTLASER1), ROS messages as JSON (the first line
// begins with a brace; laser_json.h), whose scans are divided into segments, or the segments of one scan as
// lines x0,y0,x1,y1[,sigma_angle_deg,sigma_offset_m] in the robot's frame, metres.
// Errors: those of ReadCarmenLog and ParseLaserJson; Corrupt (a line that is not a segment), NoData (nothing
// in the file).
Result<std::vector<ScanView>> ReadScans(const std::string& path, const ScanSegmentsOptions& options);
Result<std::vector<ScanView>> ParseScans(const std::string& text, const std::string& what,
                                         const ScanSegmentsOptions& options);
// The scans of a log or of messages, as they are.  Errors: as ReadScans; NoData for a file of segments, too.
Result<std::vector<RangeScan>> ReadRangeScans(const std::string& path);

}  // namespace cairn
