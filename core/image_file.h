#pragma once

#include <string>
#include <string_view>

#include <opencv2/core/mat.hpp>

#include "core/error.h"

namespace cairn {

// Decodes an image file's bytes to 8-bit grey, CV_8UC1; EXIF rotation is not applied, 16-bit images lose
// their low byte. `path` is for messages only. Errors: Corrupt (zero bytes, not an image that OpenCV reads,
// or a JPEG or PNG that stops before its end marker: OpenCV would fill the rest with grey and say nothing),
// each naming the file and what was found.
Result<cv::Mat> DecodeGreyImage(std::string_view bytes, const std::string& path);

// The same from a file.  Errors: also NotFound, Io.
Result<cv::Mat> ReadGreyImage(const std::string& path);

}  // namespace cairn
