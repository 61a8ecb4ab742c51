#pragma once

#include <optional>
#include <string>

#include "core/capture/frame_choice.h"
#include "core/geometry/pose.h"

namespace cairn::pipeline {

// How a bag is imported.
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

}  // namespace cairn::pipeline
