#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/pose.h"

namespace cairn::reconstruct {

// What an inertial measurement unit (IMU) says at one time, in its own axes.
struct ImuSample {
  int64_t time_ns = 0;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   // rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  // specific force, m/s^2: +9.81 upwards at rest
};

struct ImuRecording {
  std::vector<ImuSample> samples;  // ascending times
  double typical_step_s = 0;       // median time from one to the next
  // Where the IMU is on the camera: its axes and place in the camera's frame (x right, y down, z ahead).
  std::optional<Pose> cam_from_imu;
};

// Samples that are farther apart than this leave a gap, seconds: what moved in between is not known.
inline constexpr double kMaxImuStepS = 0.1;

// A capture's imu.csv, in the layout of EuRoC's data.csv: "TIME_NS,WX,WY,WZ,AX,AY,AZ" a line, times
// ascending; lines that begin with '#' and a first line of words are skipped, except for one that says where
// the IMU is on the camera: "#imu_on_camera,X,Y,Z,QX,QY,QZ,QW", metres and quaternion. Errors: NotFound, Io;
// Corrupt, with the line (not an integer and six finite numbers; a time that is not after that before; a
// place that is none); NoData for what is of no use: fewer than 50 or more than 10,000 samples a second
// (times in another unit), turns of more than 35 rad/s or accelerations whose median is not that of gravity
// (other units, or gravity taken out), less than a second of samples.
Result<ImuRecording> ReadImu(const std::string& path);

}  // namespace cairn::reconstruct
