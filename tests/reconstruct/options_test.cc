#include <gtest/gtest.h>

#include "stages/reconstruct/reconstruct.h"
#include "tests/option_limits.h"

namespace cairn::reconstruct {
namespace {

TEST(ReconstructOptions, OptionsHaveTheRangesOfTheirComments) {
  ExpectLimits<ReconstructOptions>({{"min_registered_ratio", "0", "-0.001", "1", "1.001"},
                                    {"rig_sigma_ratio", "1e-6", "9e-7"},
                                    {"control_point_sigma_m", "1e-6", "9e-7"},
                                    {"distance_sigma_ratio", "1e-6", "9e-7"},
                                    {"odometry_sigma_ratio", "1e-6", "9e-7"},
                                    {"imu_sigma_ratio", "1e-6", "9e-7"},
                                    {"imu_accel_noise", "1e-6", "9e-7"},
                                    {"camera_height_sigma_m", "1e-6", "9e-7"},
                                    {"unscaled_depth", "1e-6", "9e-7"},
                                    {"gps_sigma_m", "1e-3", "9e-4"},
                                    {"gps_altitude_sigma_m", "1e-3", "9e-4"},
                                    {"imu_gyro_noise", "1e-7", "9e-8"},
                                    {"camera_height_m", "0", "-0.001"},
                                    {"up_sigma_deg", "1e-3", "9e-4", "180", "180.18"},
                                    {"hold_out_every", "0", "-1"}});
}

}  // namespace
}  // namespace cairn::reconstruct
