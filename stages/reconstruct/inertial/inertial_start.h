#pragma once

#include <optional>
#include <vector>

#include "stages/reconstruct/inertial/imu_turn.h"
#include "stages/reconstruct/inertial/inertial_alignment.h"

namespace cairn::reconstruct {

inline constexpr double kGravityMS2 = 9.80665;  // within 0.3 % of what it is anywhere on the ground

// What the IMU says between two images that follow each other.
struct InertialStep {
  size_t from = 0, to = 0;  // of InertialStart::images
  Preintegrated imu;
};

// What InertialAlignment begins with.
struct InertialStart {
  std::vector<TimedImage> images;  // those in a step; times by the IMU's clock
  std::vector<size_t> image_idx;   // of those given
  std::vector<InertialStep> steps;
  ImuTurn turn;
  Eigen::Vector3d imu_in_cam_m = Eigen::Vector3d::Zero();
  double time_offset_s = 0;
  std::vector<Eigen::Vector3d> speeds;                // of the IMU, m/s, model's axes
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  // m/s^2, model's axes
  double scale = 0;  // metres per unit; may be negative where nothing shows it
};

// Steps, turn and clock, then speeds, gravity and scale by linear least squares [Qin18 eq. 11].  Errors:
// those of AlignToImu.
Result<InertialStart> StartInertial(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                    const InertialOptions& options);

}  // namespace cairn::reconstruct
