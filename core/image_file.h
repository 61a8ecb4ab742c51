#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "core/error.h"

namespace cairn {

// Decodes an image file to 8-bit grey; EXIF rotation is not applied.
// Errors: NotFound, Corrupt (zero bytes, not an image, or a JPEG or PNG that ends before its end marker: OpenCV fills the
// rest with grey and says nothing), each naming the file and what was found.
Result<cv::Mat> ReadGreyImage(const std::string& path);

// Width and height from the header, without decoding.  Errors as above.
struct ImageSize {
  int width = 0;
  int height = 0;
};
Result<ImageSize> ReadImageSize(const std::string& path);

}  // namespace cairn
