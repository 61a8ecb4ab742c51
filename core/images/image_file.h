#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"

namespace cairn {

// Whether a file's name ends as those of images do (.jpg, .PNG, ...).
bool HasImageSuffix(const std::string& path);

// Decodes an image file's bytes to 8-bit grey, CV_8UC1.  EXIF rotation is not applied, whatever its value;
// 16-bit images lose their low byte; colour and CMYK become grey; alpha is ignored; of an animated PNG the
// first frame is read.  `path` is for messages only.  Errors: Corrupt, naming the file and what was found:
// zero bytes, not an image that OpenCV reads, a JPEG, PNG or WebP that stops before its end (OpenCV would
// fill the rest with grey and say nothing), GIF, animated WebP, more than 2^30 pixels or 2^31 - 1 bytes.
// Memory: one byte a pixel, and the decoder's.  This and the two below load OpenCV's codecs when they are
// first called (image_module.h); errors: also NotFound, Unsupported (these).
Result<cv::Mat> DecodeGreyImage(std::string_view bytes, const std::string& path);

// The same from a file.  Errors: also NotFound, Io.
Result<cv::Mat> ReadGreyImage(const std::string& path);

// A JPEG's, or a PNG's, bytes of an 8-bit image.  `path` is for messages only; quality in 1 to 100.
// Errors: Failed.
Result<std::string> EncodeJpeg(const cv::Mat& image, int quality, const std::string& path);
Result<std::string> EncodePng(const cv::Mat& image, const std::string& path);

// Whether image files can be read and written here; `path` is for messages only.  Errors: NotFound,
// Unsupported.
Status CheckImageCodecs(const std::string& path);

// A hash of what decodes image files here: OpenCV's codecs and the libraries of the formats.  Errors: as
// CheckImageCodecs.
Result<std::string> ImageCodecsIdentity(const std::string& path);

// Image files by their bytes, to find one that is another's copy under another name.  Only files of one size
// are read.
class ImageCopies {
 public:
  // The first file that was given with the same bytes; null: there is none, or the file cannot be read.
  const std::string* FindOrAdd(const std::string& path);

 private:
  struct Given {
    std::string path;
    std::string hash;  // empty: not needed so far
  };
  std::map<uintmax_t, std::vector<Given>> of_size_;
};

}  // namespace cairn
