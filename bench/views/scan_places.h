#pragma once

#include <chrono>
#include <cmath>

#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"

namespace cairn {

inline double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Whether a scan's place was found.
inline bool IsRight(const PlanarPose& found, const PlanarPose& pose, double metres = 0.25,
                    double degrees = 5) {
  return (found.position - pose.position).norm() <= metres &&
         std::abs(WrapAngle(found.heading_rad - pose.heading_rad)) <= RadFromDeg(degrees);
}

}  // namespace cairn
