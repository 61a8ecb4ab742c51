#pragma once

#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/geometry/geodesy.h"

namespace cairn {

// What a capture's coordinates mean, where it says so: ROOT/frame.json, written by `reconstruct`.
struct CaptureFrame {
  // "metre", or "arbitrary" where nothing gave a reconstruction its scale.
  std::string unit = "metre";
  // The world frame is east, north, up at this place; none: nothing ties the frame to the Earth.
  std::optional<GeodeticPosition> anchor;
  // Where scale and axes come from: "survey", "odometry", "gps", "control_points", "distances", "mixed" or
  // "none".
  std::string source = "survey";
  // The poses come from the images themselves: they already fit them best and are not refined again.
  bool is_reconstructed = false;
};

inline constexpr const char* kCaptureFrameFile = "frame.json";

// Errors: InvalidArgument for an invalid unit or anchor.
Status CheckCaptureFrame(const CaptureFrame& frame);
std::string CaptureFrameJson(const CaptureFrame& frame);
// Errors: NotFound, Corrupt (the file, and what was expected).
Result<CaptureFrame> ReadCaptureFrame(const std::string& path);

}  // namespace cairn
