#pragma once

#include <cmath>

#include <Eigen/Core>

#include "core/geometry/pose.h"

namespace cairn {

// Where a camera stands on the floor and in which direction it looks.
struct FloorPose {
  Eigen::Vector2d position;  // floor frame, metres
  double heading_deg;        // counter-clockwise from +x, [0, 360)
};

inline double AngleBetweenDeg(double a, double b) { return std::abs(std::remainder(a - b, 360.0)); }

// The heading of a camera that looks up or down, within 15 degrees, is the direction of its image's top.
FloorPose FloorPoseOf(const Pose& cam_from_world, const Pose& floor_from_world);

}  // namespace cairn
