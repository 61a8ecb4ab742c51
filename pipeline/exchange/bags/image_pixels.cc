#include "pipeline/exchange/bags/image_pixels.h"

#include <map>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "core/base/no_throw.h"
#include "core/images/image_file.h"

namespace cairn::pipeline {
namespace {

constexpr uint64_t kMaxPixels = 1 << 30;
// convertTo rounds to the nearest: with these 16 bits become their high byte.
constexpr double kHighByte = 1.0 / 256;
constexpr double kHighByteOffset = -0.498;

struct PixelEncoding {
  int type;                            // of OpenCV's matrix
  std::optional<int> conversion = {};  // cv::ColorConversionCodes, to grey or blue first; none: as it is
};

// sensor_msgs/image_encodings.  Bayer patterns are named by ROS after their first two rows' pixels, by OpenCV
// after the second row's second and third.
const std::map<std::string, PixelEncoding>& PixelEncodings() {
  static const std::map<std::string, PixelEncoding> kEncodings = {
      {"mono8", {CV_8UC1}},
      {"8UC1", {CV_8UC1}},
      {"mono16", {CV_16UC1}},
      {"bgr8", {CV_8UC3}},
      {"8UC3", {CV_8UC3}},
      {"rgb8", {CV_8UC3, cv::COLOR_RGB2BGR}},
      {"bgra8", {CV_8UC4, cv::COLOR_BGRA2BGR}},
      {"8UC4", {CV_8UC4, cv::COLOR_BGRA2BGR}},
      {"rgba8", {CV_8UC4, cv::COLOR_RGBA2BGR}},
      {"yuv422", {CV_8UC2, cv::COLOR_YUV2BGR_UYVY}},
      {"uyvy", {CV_8UC2, cv::COLOR_YUV2BGR_UYVY}},
      {"yuv422_yuy2", {CV_8UC2, cv::COLOR_YUV2BGR_YUY2}},
      {"yuyv", {CV_8UC2, cv::COLOR_YUV2BGR_YUY2}},
      {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2BGR}},
      {"bayer_rggb16", {CV_16UC1, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr16", {CV_16UC1, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg16", {CV_16UC1, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg16", {CV_16UC1, cv::COLOR_BayerGB2BGR}},
  };
  return kEncodings;
}

std::string EncodingNames() {
  std::string names;
  for (const auto& [name, encoding] : PixelEncodings()) names += (names.empty() ? "" : ", ") + name;
  return names;
}

Status CheckSize(const ImageMessage& image, const PixelEncoding& encoding) {
  const uint64_t num_pixels = static_cast<uint64_t>(image.width) * image.height;
  if (num_pixels == 0) return MakeError(ErrorCode::kCorrupt, "{} x {} pixels", image.width, image.height);
  if (num_pixels > kMaxPixels) {
    return MakeError(ErrorCode::kUnsupported, "{} x {} pixels, more than {}", image.width, image.height,
                     kMaxPixels);
  }
  const uint64_t row_bytes = static_cast<uint64_t>(image.width) * CV_ELEM_SIZE(encoding.type);
  // The last row need not be filled up.
  const uint64_t least = static_cast<uint64_t>(image.step) * (image.height - 1) + row_bytes;
  if (image.step >= row_bytes && image.bytes.size() >= least) return Ok();
  return MakeError(ErrorCode::kCorrupt,
                   "{} x {} pixels of {} need rows of {} bytes, found {} bytes in rows of {}", image.width,
                   image.height, image.encoding, row_bytes, image.bytes.size(), image.step);
}

// Two bytes a pixel, in this machine's order.
cv::Mat NativeOrder(const cv::Mat& pixels, bool is_big_endian) {
  cv::Mat swapped = pixels.clone();
  if (!is_big_endian) return swapped;
  for (int row = 0; row < swapped.rows; ++row) {
    auto* const bytes = swapped.ptr<uint8_t>(row);
    for (size_t i = 0; i < swapped.cols * swapped.elemSize(); i += 2) std::swap(bytes[i], bytes[i + 1]);
  }
  return swapped;
}

}  // namespace

bool IsPictureEncoding(const std::string& encoding) { return PixelEncodings().contains(encoding); }

Result<BagPicture> PictureOf(const ImageMessage& image) {
  const auto found = PixelEncodings().find(image.encoding);
  if (found == PixelEncodings().end()) {
    return MakeError(ErrorCode::kUnsupported, "its encoding is '{}', known are {}", image.encoding,
                     EncodingNames());
  }
  const PixelEncoding& encoding = found->second;
  CAIRN_RETURN_IF_ERROR(CheckSize(image, encoding));
  try {
    // OpenCV has no matrix of constant memory; it is only read.
    const cv::Mat view(static_cast<int>(image.height), static_cast<int>(image.width), encoding.type,
                       const_cast<char*>(image.bytes.data()), image.step);
    BagPicture picture;
    cv::Mat pixels = CV_MAT_DEPTH(encoding.type) == CV_16U ? NativeOrder(view, image.is_big_endian) : view;
    if (encoding.conversion) {
      // 16 bits a colour are cut to 8 first: nothing later reads more.
      if (pixels.depth() == CV_16U) pixels.convertTo(pixels, CV_8U, kHighByte, kHighByteOffset);
      cv::cvtColor(pixels, picture.pixels, *encoding.conversion);
    } else {
      picture.pixels = pixels.clone();
    }
    if (picture.pixels.channels() == 3) {
      cv::cvtColor(picture.pixels, picture.grey, cv::COLOR_BGR2GRAY);
    } else if (picture.pixels.depth() == CV_16U) {
      picture.pixels.convertTo(picture.grey, CV_8U, kHighByte, kHighByteOffset);
    } else {
      picture.grey = picture.pixels;
    }
    return picture;
  } catch (const cv::Exception& exception) {
    if (IsOutOfMemory(exception)) throw;
    return MakeError(ErrorCode::kCorrupt, "OpenCV says: {}", exception.err);
  }
}

Result<BagPicture> PictureOf(const CompressedImageMessage& image) {
  BagPicture picture;
  if (image.bytes.starts_with("\xff\xd8")) {
    picture.suffix = ".jpg";
  } else if (!image.bytes.starts_with("\x89PNG")) {
    return MakeError(ErrorCode::kUnsupported, "its format is '{}', and it is neither a JPEG nor a PNG file",
                     image.format);
  }
  CAIRN_ASSIGN_OR_RETURN(picture.grey, DecodeGreyImage(image.bytes, "the image"));
  picture.encoded = std::string(image.bytes);
  return picture;
}

Result<std::string> FileOf(const BagPicture& picture) {
  if (!picture.encoded.empty()) return picture.encoded;
  return EncodePng(picture.pixels, "the image");
}

}  // namespace cairn::pipeline
