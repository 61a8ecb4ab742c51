#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/inertial/imu_file.h"
#include "stages/reconstruct/inertial/preintegration.h"

namespace cairn::reconstruct {

// An image of a reconstruction, with the time at which it was taken, by the clock of an IMU.
struct TimedImage {
  std::string name;
  int64_t time_ns = 0;
  Pose cam_from_model;
};

struct InertialOptions {
  ImuNoise noise;
  // Standard deviations of what an IMU's place on the camera errs by where it is stated, and of where it is
  // where it is not, metres; of a stated turn, degrees.
  double stated_place_sigma_m = 0.01;
  double unknown_place_sigma_m = 0.1;
  double stated_turn_sigma_deg = 1;
  // Of the accelerometer's bias, m/s^2, and of its change in a second; the same of the gyro, rad/s.
  double accel_bias_sigma = 0.1;
  double accel_bias_walk = 1e-3;
  double gyro_bias_sigma = 0.1;
  double gyro_bias_walk = 5e-5;
  // Of the clocks' difference, once it is found to 10 ms, seconds.
  double time_sigma_s = 0.01;
  // Images that are farther apart, seconds, say nothing of each other: the drift of the accelerometer counts
  // with the square of the time.
  double max_step_s = 5;
};

struct InertialAlignment {
  double scale = 0;        // metres per unit of the model; 0: the motion does not show it at all
  double sigma_ratio = 0;  // standard deviation of the scale, as a part of it
  // Of which by the noise of images and IMU alone, and by how much parts of the way disagree.
  double noise_sigma_ratio = 0, parts_sigma_ratio = 0;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // against gravity, of length 1, model
  double up_sigma_rad = 0;
  Eigen::Quaterniond cam_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d imu_in_cam_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero(), accel_bias = Eigen::Vector3d::Zero();  // means
  double time_offset_s = 0;                      // an image was taken that much later than it says
  double place_sigma_m = 0, turn_sigma_rad = 0;  // of single images, as they turned out
  double imu_noise_ratio = 0;                    // over what the options say
  std::vector<size_t> image_idx;                 // those that it is of
  std::vector<double> residuals_m;               // of these: between where it is and where the IMU has it
  std::vector<bool> is_off;                      // by more than four standard deviations
};

// Scale and vertical of a reconstruction from an IMU.  The accelerometer measures how the camera moves, in
// metres, and gravity, of a known size; both must agree with the images' places.
//
// Begins as [Qin18 V-B] and [MurArtal17b IV]: the turns of images and gyro give the gyro's bias (imu_turn.h),
// the clocks' difference and, where it is not stated, how the IMU is turned against the camera; then speeds,
// gravity and scale are a linear least-squares problem in what the IMU says between the images
// (preintegration.h).  From there the most likely of all unknowns at once follows [Campos20], but with images
// that err, too:
//
//   min sum_k |r_k|^2 / (kappa^2 S_k)                          between images k and k + 1 [Forster17 eq. 45]
//     + sum_i rho(|turn_i|^2 / sigma_turn^2) + rho(|shift_i|^2 / sigma_shift^2)     images, in the model's
//     unit
//     + what is stated: the IMU's place and turn, its biases (one for each half minute, a random walk),
//     clocks
//
// over scale, direction of gravity, place, turn, biases, clocks' difference, and turn, shift and speed of
// every image; rho: Huber's.  sigma_turn, sigma_shift and kappa >= 1 (noise beyond the data sheet's:
// vibration) are those that the residuals show [Foerstner79].  Without the images' own errors the scale would
// be too small wherever these are as large as what the IMU shows.
//
// Errors of the images' places look like accelerations, too.  Of the information I on the scale's logarithm
// the part N that these errors alone would give is none: sigma = sqrt(I) / (I - N), and infinite from N = I /
// 2 on, as for a camera that moves straight ahead at one speed.
//
// The scale's standard deviation is that one, or, where it is larger, what parts of the way say:
// residuals of neighbours are correlated (a reconstruction bends, vibration comes and goes), so each of
// twelve pieces of the way counts as one: sigma^2 = sum over pieces of (sum of w_k r_k in the piece)^2, w the
// influence of a residual on the logarithm of the scale.  Of fewer than 60 images it is twice that of noise.
// What all pieces share (the accelerometer's own
// scale) is in neither.
//
// `images` in the order of their times.  Same result for any number of threads.  O(images + samples).
// Errors: NoData, with what is missing: images in the IMU's time, turns about two axes where the IMU's turn
// is not stated; gyro and images that disagree (units, another clock, a wrong statement).
Result<InertialAlignment> AlignToImu(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                     const InertialOptions& options);

}  // namespace cairn::reconstruct
