#include "sim/robot/sensors.h"

#include "core/base/random.h"

namespace cairn::sim {

OptionTable DescribeOptions(SensorOptions* o) {
  return {
      {"light_ratio", &o->light_ratio, "brightness of the building, as part of the survey's light", 0.01, 1},
      {"image_gain", &o->image_gain, "exposure gain of each image is uniform in 1 +- this", 0, 0.9},
      {"image_noise", &o->image_noise, "standard deviation of grey noise, of 255", 0, 50},
      {"exposure_s", &o->exposure_s,
       "time for which the shutter is open, seconds: the robot's motion meanwhile blurs the image", 0, 1},
      {"slip_ratio", &o->slip_ratio,
       "standard deviation of each wheel's way during a command, as part of the way commanded", 0, 0.5},
      {"wheel_base_m", &o->wheel_base_m, "distance of the wheels from each other, metres", 0.01, 5},
  };
}

PlanarMotion SlippedMotion(const PlanarMotion& commanded, const SensorOptions& options, uint64_t seed) {
  Random random(seed);
  const double half_base = 0.5 * options.wheel_base_m;
  const double left =
      (commanded.speed_m_s - commanded.turn_rad_s * half_base) * (1 + random.Normal(0, options.slip_ratio));
  const double right =
      (commanded.speed_m_s + commanded.turn_rad_s * half_base) * (1 + random.Normal(0, options.slip_ratio));
  return {0.5 * (left + right), (right - left) / options.wheel_base_m};
}

PlannedImage ExposeImage(const PlanarPose& pose, const PlanarMotion& motion, double camera_height_m,
                         const SensorOptions& options, uint64_t seed) {
  Random random(seed);
  PlannedImage image;
  image.cam_from_world = MakePose({pose.position.x(), pose.position.y(), camera_height_m}, pose.heading_rad);
  image.noise = options.image_noise;
  image.gain = options.light_ratio * random.Uniform(1 - options.image_gain, 1 + options.image_gain);
  // Camera frame: x right, y down, z ahead.  Where a robot turns left, the scene turns right: about y.
  image.turn = {0, motion.turn_rad_s * options.exposure_s, 0};
  image.way = {0, 0, motion.speed_m_s * options.exposure_s};
  return image;
}

}  // namespace cairn::sim
