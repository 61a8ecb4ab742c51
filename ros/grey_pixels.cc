#include "ros/grey_pixels.h"

#include <opencv2/imgproc.hpp>

namespace cairn {

Result<cv::Mat> GreyPixels(const ImageView& image) {
  const bool is_grey = image.encoding == "mono8" || image.encoding == "8UC1";
  if (!is_grey && image.encoding != "bgr8" && image.encoding != "rgb8")
    return MakeError(ErrorCode::kUnsupported, "image of encoding '{}'; mono8, bgr8 and rgb8 are read",
                     image.encoding);
  const uint64_t row_bytes = uint64_t{image.width} * (is_grey ? 1 : 3);
  if (image.width == 0 || image.height == 0 || image.width > 65536 || image.height > 65536 ||
      image.step < row_bytes || image.num_bytes < uint64_t{image.step} * (image.height - 1) + row_bytes)
    return MakeError(ErrorCode::kInvalidArgument,
                     "image of {} x {} px ({}) with a step of {} and {} bytes of data", image.width,
                     image.height, image.encoding, image.step, image.num_bytes);
  const cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width),
                       is_grey ? CV_8UC1 : CV_8UC3, const_cast<uint8_t*>(image.bytes), image.step);
  if (is_grey) return pixels;
  cv::Mat grey;
  cv::cvtColor(pixels, grey, image.encoding == "bgr8" ? cv::COLOR_BGR2GRAY : cv::COLOR_RGB2GRAY);
  return grey;
}

}  // namespace cairn
