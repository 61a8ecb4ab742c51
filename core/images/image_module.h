#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace cairn {

// What images.so, the part of the program that links OpenCV's codecs (image_codecs.cc), gives to the rest
// under the name kImageModuleName (core/modules/module.h).
struct ImageModule {
  const char* version;
  // cv::imdecode to 8-bit grey, not turned by what EXIF says; empty: not an image that is known.
  cv::Mat (*decode_grey)(const cv::Mat& bytes);
  // cv::imencode as ".jpg", ".png"; 0 < quality <= 100: of a JPEG.
  bool (*encode)(const std::string& suffix, const cv::Mat& image, int quality, std::vector<uint8_t>* bytes);
};
inline constexpr char kImageModuleName[] = "cairn_images_module";

}  // namespace cairn
