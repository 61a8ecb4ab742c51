#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "pipeline/exchange/bags/messages.h"

namespace cairn::pipeline {

// A recorded image as the capture keeps it.
struct BagPicture {
  cv::Mat grey;         // CV_8UC1, as the stages will read it
  cv::Mat pixels;       // of a raw image: CV_8UC1, CV_16UC1 or CV_8UC3 (blue first), to be saved as PNG
  std::string encoded;  // of a compressed image: its file
  const char* suffix = ".png";
};

// Whether an encoding of sensor_msgs/Image is one of pictures: mono8, mono16, rgb8, bgr8, rgba8, bgra8, 8UC1,
// 8UC3, 8UC4, yuv422, yuv422_yuy2, uyvy, yuyv, bayer_{rggb,bggr,gbrg,grbg}{8,16}.  Depth (16UC1, 32FC1) is
// not.
bool IsPictureEncoding(const std::string& encoding);

// A raw image.  Errors: Unsupported (encoding; more than 2^30 pixels), Corrupt (no pixel, rows shorter than
// their pixels, fewer bytes than rows).
Result<BagPicture> PictureOf(const ImageMessage& image);

// JPEG or PNG, whose bytes are taken as they are.  Errors: Unsupported (another format), Corrupt (damaged; as
// DecodeGreyImage).
Result<BagPicture> PictureOf(const CompressedImageMessage& image);

// The file's bytes, PNG or as they were recorded.  Errors: Io.
Result<std::string> FileOf(const BagPicture& picture);

}  // namespace cairn::pipeline
