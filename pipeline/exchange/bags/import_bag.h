#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/capture/frame_choice.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

struct BagOptions {
  std::string topic;     // of the images; "": the only one
  std::string odometry;  // topic; "": the only one, if any; "none": none
  std::string imu;       // topic; "": the only one, if there is one; "none": none
  // MODEL,WIDTH,HEIGHT,PARAM,... in COLMAP's pixels; empty: as camera_info states.
  std::string camera;
  FrameChoice choice = FrameChoice::kKeyframes;
  double every_s = 0;  // kEvery: time between images, seconds.  REQUIRES: > 0
  // Poses of odometry and of moving frames are interpolated between stated ones at most this far from an
  // image, seconds: ten a second, as slow wheel odometry has them, and one lost.  REQUIRES: >= 0
  double max_time_gap_s = 0.2;
  // Where the camera's optical frame is on the robot, in the odometry's child frame; none: as /tf states.
  std::optional<Pose> base_from_camera;
  // Where the IMU's frame is on the camera, in its optical frame; none: as /tf states.
  std::optional<Pose> camera_from_imu;
};

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
