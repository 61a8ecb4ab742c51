#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stages/reconstruct/inertial/imu_file.h"

namespace cairn::reconstruct {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix96d = Eigen::Matrix<double, 9, 6>;

// Of the white noise of an IMU, as its data sheet states them.
struct ImuNoise {
  double gyro_rad_s_rthz = 0.002;  // rad/s/sqrt(Hz)
  double accel_m_s2_rthz = 0.02;   // m/s^2/sqrt(Hz)
};

// What an IMU says of the motion from one time to another, whatever speed and attitude it began with
// [Forster17 eqs. 33, 37]:
//   R_j = R_i dR,   v_j = v_i + g dt + R_i dv,   p_j = p_i + v_i dt + g dt^2 / 2 + R_i dp
// Rows of jacobian and covariance: turn (to the right of dR), dv, dp.
struct Preintegrated {
  double dt_s = 0;
  Eigen::Quaterniond dR = Eigen::Quaterniond::Identity();
  Eigen::Vector3d dv = Eigen::Vector3d::Zero(), dp = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero(), accel_bias = Eigen::Vector3d::Zero();  // taken off
  Matrix96d by_bias = Matrix96d::Zero();                 // derivatives; columns: gyro's bias, accelerometer's
  Matrix9d covariance = Matrix9d::Zero();                // of the white noise
  Eigen::Vector3d gyro_begin = Eigen::Vector3d::Zero();  // rad/s at both ends, without the bias
  Eigen::Vector3d gyro_end = Eigen::Vector3d::Zero();
};

// Integrates samples from one time to a later one, by the midpoint rule; samples are interpolated at both
// ends. None: one of the times is not between two samples that are at most kMaxImuStepS apart, or there is a
// gap between them.  REQUIRES: begin_ns < end_ns, samples ascending.  O(log of all samples + those between).
std::optional<Preintegrated> Preintegrate(const std::vector<ImuSample>& samples, int64_t begin_ns,
                                          int64_t end_ns, const Eigen::Vector3d& gyro_bias,
                                          const Eigen::Vector3d& accel_bias, const ImuNoise& noise);

}  // namespace cairn::reconstruct
