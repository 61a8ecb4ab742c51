#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/files/file.h"
#include "tests/pipeline/exchange/bag_writers.h"

namespace cairn::pipeline {

inline constexpr int64_t kSecondNs = 1'000'000'000;

// Half a metre above the base and ahead of it; looks ahead.
inline const Pose kBaseFromCamera = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.2, 0, 0.5}};

// What a robot on a rendered drive records: its camera, of the images `first` to `end` four a second, and
// wheels without error.
inline std::vector<Recorded> RecordedDrive(const Capture& drive, size_t first, size_t end,
                                           MessageForm form = MessageForm::kCdr,
                                           const std::string& camera = "/camera") {
  std::vector<Recorded> messages = {
      {"/tf_static", "tf2_msgs/msg/TFMessage", 0,
       TransformBytes({{"base_link", "camera_optical", kBaseFromCamera}}, form)}};
  const Camera& lens = drive.cameras.begin()->second;
  // ROS counts from the first pixel's centre.
  const double cx = lens.params[2] - 0.5, cy = lens.params[3] - 0.5;
  const CameraInfoFields info = {.width = lens.width,
                                 .height = lens.height,
                                 .d = {0, 0, 0, 0, 0},
                                 .k = {lens.params[0], 0, cx, 0, lens.params[1], cy, 0, 0, 1},
                                 .p = {lens.params[0], 0, cx, 0, 0, lens.params[1], cy, 0, 0, 0, 1, 0}};
  for (size_t i = first; i < std::min(end, drive.images.size()); ++i) {
    const CaptureImage& image = drive.images[i];
    const auto time_ns = static_cast<int64_t>(i + 4) * kSecondNs / 4;
    messages.push_back(
        {"/odom", "nav_msgs/msg/Odometry", time_ns,
         OdometryBytes(time_ns, image.cam_from_world->Inverse() * kBaseFromCamera.Inverse(), form)});
    messages.push_back(
        {camera + "/camera_info", "sensor_msgs/msg/CameraInfo", time_ns, CameraInfoBytes(info, form)});
    messages.push_back({camera + "/image_raw/compressed", "sensor_msgs/msg/CompressedImage", time_ns,
                        CompressedImageBytes(time_ns, "jpeg", *ReadFile(drive.ImagePath(image)), form)});
  }
  return messages;
}

}  // namespace cairn::pipeline
