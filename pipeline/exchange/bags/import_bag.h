#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "pipeline/exchange/bags/bag_options.h"

namespace cairn::pipeline {

struct BagReport {
  std::string topic;
  int64_t num_messages = 0;  // of the topic
  int64_t num_images = 0;    // written
  int64_t num_cameras = 0;
  int64_t num_with_odometry = 0;
  int64_t num_imu_samples = 0;
  std::vector<std::string> warnings;  // damage, what was assumed or left out: a sentence each
};

// Writes a bag (bag.h) as a capture without poses, in one step: images/SECONDS.png or .jpg, named by the
// stamps of their headers, so that the order of names is that of time; cameras.txt from camera_info;
// odometry.txt where odometry and the camera's place on the robot are known: NAME TX TY TZ QX QY QZ QW on
// each line, world_from_camera in the odometry's frame, metres, the camera's optical axes (x right, y down, z
// ahead).
//
//   world_from_camera = world_from_base (odometry) * base_from_camera (/tf_static, /tf)
//
// And imu.csv where it has an IMU (stages/reconstruct/inertial/imu_file.h), with the line that says where it
// is on the camera where tf, at the first image's stamp, or the options know it.
//
// The bag is read twice; memory: a chunk of the bag, three images, the odometry and the IMU.
// Errors: those of OpenBag, ChooseImages, ChooseOdometry and ChooseImu; InvalidArgument (the camera; or it is
// of another size than the images), NoData (no image can be read, or the camera never moves), Io, Cancelled.
Result<BagReport> ImportBag(const std::string& path, const BagOptions& options, const std::string& output,
                            Progress& progress);

}  // namespace cairn::pipeline
