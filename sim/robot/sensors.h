#pragma once

#include <cstdint>

#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "sim/survey/survey.h"

namespace cairn::sim {

// What a robot's camera and wheels do to what it sees and to where it goes.  All at 0 (light_ratio at 1): an
// ideal camera and ideal wheels.
struct SensorOptions {
  // Brightness of the building, as part of the light that it was surveyed in.  REQUIRES: in [0.01, 1]
  double light_ratio = 0.8;
  // The gain that the camera's automatic exposure chooses is uniform in 1 +- image_gain, another for each
  // image.  REQUIRES: in [0, 0.9]
  double image_gain = 0.25;
  // Standard deviation of the noise of the image's grey values, of 255.  REQUIRES: in [0, 50]
  double image_noise = 2;
  // How long the shutter is open, seconds: the robot's motion meanwhile blurs the image.  REQUIRES: in [0, 1]
  double exposure_s = 0.02;
  // Standard deviation of the way of each wheel during a command, as part of the way commanded: the floor is
  // not even, wheels slip.  REQUIRES: in [0, 0.5]
  double slip_ratio = 0.05;
  // Distance of the two wheels from each other, metres.  REQUIRES: in [0.01, 5]
  double wheel_base_m = 0.3;
};
OptionTable DescribeOptions(SensorOptions* options);

// How a robot moves over the floor.
struct PlanarMotion {
  double speed_m_s = 0;   // ahead; negative: backwards
  double turn_rad_s = 0;  // left positive
};

// How it moves where its wheels slip, each by itself: a robot with two driven wheels.  Deterministic by seed.
PlanarMotion SlippedMotion(const PlanarMotion& commanded, const SensorOptions& options, uint64_t seed);

// The image that a robot takes which is at `pose` in the middle of the exposure.  Deterministic by seed.
PlannedImage ExposeImage(const PlanarPose& pose, const PlanarMotion& motion, double camera_height_m,
                         const SensorOptions& options, uint64_t seed);

}  // namespace cairn::sim
