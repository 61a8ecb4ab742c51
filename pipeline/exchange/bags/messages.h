#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/pose.h"
#include "pipeline/exchange/bags/files/bag.h"

namespace cairn::pipeline {

// The messages of ROS that an import reads, of both generations.  Errors of all: Corrupt (fewer bytes than
// the fields need), Unsupported (a serialization other than CDR and ROS 1); without the file's name.

struct MessageHeader {
  int64_t stamp_ns = 0;  // since 1970, or whatever the robot's clock counts from; 0: not set
  std::string frame_id;  // without a leading '/'
};

// std_msgs/Header, with which images, camera_info and odometry begin.
Result<MessageHeader> DecodeHeader(const BagMessage& message);

struct ImageMessage {
  MessageHeader header;
  uint32_t width = 0, height = 0;
  std::string encoding;  // "bgr8"
  bool is_big_endian = false;
  uint32_t step = 0;       // bytes from row to row
  std::string_view bytes;  // part of the message
};
Result<ImageMessage> DecodeImage(const BagMessage& message);

struct CompressedImageMessage {
  MessageHeader header;
  std::string format;      // "jpeg", "bgr8; jpeg compressed bgr8"
  std::string_view bytes;  // part of the message
};
Result<CompressedImageMessage> DecodeCompressedImage(const BagMessage& message);

struct CameraInfoMessage {
  MessageHeader header;
  uint32_t width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k = {};
  std::array<double, 12> p = {};
  uint32_t binning_x = 0, binning_y = 0;   // 0 is 1
  uint32_t roi_x = 0, roi_y = 0;           // of the part of the sensor that is sent; px before binning
  uint32_t roi_width = 0, roi_height = 0;  // 0: all of it
  bool operator==(const CameraInfoMessage& other) const;  // but for the header
};
Result<CameraInfoMessage> DecodeCameraInfo(const BagMessage& message);

struct OdometryMessage {
  MessageHeader header;  // frame_id: "odom"
  std::string child_frame_id;
  Pose odom_from_child;
};
// Errors: also Corrupt for a pose that is not finite, or whose quaternion is not of length 1 to 0.01.
Result<OdometryMessage> DecodeOdometry(const BagMessage& message);

struct ImuMessage {
  MessageHeader header;                                  // frame_id: the IMU's
  Eigen::Vector3d turn_rad_s = Eigen::Vector3d::Zero();  // angular velocity
  Eigen::Vector3d accel_m_s2 = Eigen::Vector3d::Zero();  // linear acceleration, with gravity
};
// Errors: also Corrupt for values that are not finite, and where a covariance that begins with -1 says that
// there is no angular velocity or no acceleration.
Result<ImuMessage> DecodeImu(const BagMessage& message);

struct TransformMessage {
  MessageHeader header;  // frame_id: the parent
  std::string child_frame_id;
  Pose parent_from_child;
};
// Those of a tf2_msgs/TFMessage.  What has no valid pose is left out and counted in `num_invalid`.
Result<std::vector<TransformMessage>> DecodeTransforms(const BagMessage& message, int64_t* num_invalid);

}  // namespace cairn::pipeline
