#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"

namespace cairn {

// An image with the fields of sensor_msgs/Image.
struct ImageView {
  std::string encoding;
  uint32_t width = 0, height = 0;  // px
  uint32_t step = 0;               // bytes from the start of one row to the next
  const uint8_t* bytes = nullptr;
  size_t num_bytes = 0;
};

// Its grey pixels: mono8 as they are, not copied; bgr8 and rgb8 converted to grey.  Errors: Unsupported for
// another encoding; InvalidArgument for rows that do not fit in the step or the bytes.
Result<cv::Mat> GreyPixels(const ImageView& image);

}  // namespace cairn
