#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/geodesy.h"

namespace cairn {

// What a capture's coordinates mean, where it says so: ROOT/frame.json, written by `reconstruct`.
struct CaptureFrame {
  // "metre", or "arbitrary" where nothing gave a reconstruction its scale.
  std::string unit = "metre";
  // The world frame is east, north, up at this place; none: nothing ties the frame to the Earth.
  std::optional<GeodeticPosition> anchor;
  // Where scale and axes come from: "survey", "control_points", "odometry", "imu", "gps",
  // "rig", "camera_height", "distances", "mixed" or "none".
  std::string source = "survey";
  // The poses come from the images themselves: they already fit them best and are not refined again.
  bool is_reconstructed = false;
  // The cameras of these poses were refined from the images along with some of them: they are better than
  // those that features were found with.
  bool has_refined_cameras = false;
  // Standard deviation of the scale, as a part of it, and the place in the world frame, metres, about which
  // all grows or shrinks with it: what was held there when the frame was found.  0: of stated poses, or the
  // unit is arbitrary.
  double scale_sigma_ratio = 0;
  Eigen::Vector3d scale_centre = Eigen::Vector3d::Zero();
};

// How far a point of the world frame moves where the scale is one standard deviation too small, metres.
// Another point moves by another multiple of the same error.
inline Eigen::Vector3d ScaleSigmaAt(const CaptureFrame& frame, const Eigen::Vector3d& point) {
  return frame.scale_sigma_ratio * (point - frame.scale_centre);
}

inline bool IsMetric(const CaptureFrame& frame) { return frame.unit == "metre"; }

// Lengths of the world frame for people: "m", or "units" where the unit is arbitrary; and a short one in
// centimetres, "1.25 cm", there "0.0125 units".
const char* LengthUnit(const CaptureFrame& frame);
std::string ShortLength(const CaptureFrame& frame, double length, int digits = 2);

inline constexpr const char* kCaptureFrameFile = "frame.json";

// Errors: InvalidArgument for an invalid unit, anchor or standard deviation of the scale.
Status CheckCaptureFrame(const CaptureFrame& frame);
std::string CaptureFrameJson(const CaptureFrame& frame);
// Errors: NotFound, Corrupt (the file, and what was expected).
Result<CaptureFrame> ReadCaptureFrame(const std::string& path);

}  // namespace cairn
