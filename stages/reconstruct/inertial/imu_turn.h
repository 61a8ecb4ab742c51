#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn::reconstruct {

// A turn from one image to a later one, as rotation vectors, rad: in the camera's axes by the images, in the
// IMU's by its gyro.
struct TurnPair {
  Eigen::Vector3d of_camera = Eigen::Vector3d::Zero();
  Eigen::Vector3d of_imu = Eigen::Vector3d::Zero();
  double dt_s = 0;
};

struct ImuTurn {
  Eigen::Quaterniond cam_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  // rad/s
  double spread_rad = 0;  // of what the two disagree by, per axis: standard deviation by the median
  double sigma_rad =
      0;  // of cam_from_imu about the axis about which it is known worst; 0 where it was stated
  double left_ratio = 0;  // of the squared turns of the camera: what is left unexplained
};

// How an IMU is turned against the camera, and its gyro's bias, from turns that both have seen (hand-eye
// calibration from rotations alone):
//   min sum_k rho( |of_camera_k - R (of_imu_k - bias dt_k)|^2 )
// R and bias in turns, R in closed form [Umeyama91] of the turns, with Cauchy's weights by the median.  It
// needs turns about two axes at least: sigma_rad says whether there were.  With `stated` R is that. REQUIRES:
// not empty
ImuTurn FitImuTurn(const std::vector<TurnPair>& pairs, const std::optional<Eigen::Quaterniond>& stated);

}  // namespace cairn::reconstruct
