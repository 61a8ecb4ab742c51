#include "stages/reconstruct/inertial/inertial_alignment.h"

#include <limits>

#include "stages/reconstruct/inertial/inertial_adjustment.h"
#include "stages/reconstruct/inertial/inertial_start.h"

namespace cairn::reconstruct {

Result<InertialAlignment> AlignToImu(const std::vector<TimedImage>& images, const ImuRecording& imu,
                                     const InertialOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const InertialStart start, StartInertial(images, imu, options));
  const bool is_turn_stated = imu.cam_from_imu.has_value();
  if (start.scale > 0) return AdjustInertial(start, is_turn_stated, options);
  // Gravity is far larger than what the motion adds to it.
  InertialAlignment answer;
  answer.sigma_ratio = std::numeric_limits<double>::infinity();
  answer.up = -start.gravity.normalized();
  answer.up_sigma_rad = RadFromDeg(1);
  answer.cam_from_imu = start.turn.cam_from_imu;
  answer.imu_in_cam_m = start.imu_in_cam_m;
  answer.gyro_bias = start.turn.gyro_bias;
  answer.time_offset_s = start.time_offset_s;
  answer.image_idx = start.image_idx;
  return answer;
}

}  // namespace cairn::reconstruct
