#pragma once

#include <opencv2/core/mat.hpp>

#include "runtime/c_api/cairn.h"

namespace cairn {

// A picture as the C API takes it; it must live as long.
inline cairn_image ImageOf(const cv::Mat& picture) {
  cairn_image image = CAIRN_IMAGE_INIT;
  image.pixels = picture.data;
  image.width = picture.cols;
  image.height = picture.rows;
  image.stride = picture.step;
  return image;
}

}  // namespace cairn
