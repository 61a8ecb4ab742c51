#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>

#include "core/base/error.h"
#include "runtime/localize/localization.h"

namespace cairn {

// Which way was up, by what an IMU on the robot said, in the camera's frame.
class Gravity {
 public:
  // `sigma_deg`: of what the IMU says.
  Gravity(const Eigen::Quaterniond& camera_from_imu, double sigma_deg)
      : camera_from_imu_(camera_from_imu), sigma_deg_(sigma_deg) {}

  // Up in the IMU's frame, of any length, at a time.  One that is earlier than the one before begins anew.
  // Errors: as CheckSensedUp, and InvalidArgument (a time that is not finite).
  // `more_sigma_deg`: of this alone, besides that of the IMU.
  Status Add(double time_s, const Eigen::Vector3d& up_in_imu, double more_sigma_deg = 0);
  // What was said nearest to an image's time, within a tenth of a second: a robot does not tilt by degrees
  // faster.  0: the last.
  std::optional<SensedUp> At(double image_time_s) const;

 private:
  struct TimedUp {
    double time_s;
    Eigen::Vector3d up_in_imu;
    double more_sigma_deg;
  };

  Eigen::Quaterniond camera_from_imu_;
  double sigma_deg_;
  std::deque<TimedUp> ups_;
};

}  // namespace cairn
