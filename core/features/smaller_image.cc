#include "core/features/smaller_image.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace cairn {

Keypoint SmallerImage::Larger(Keypoint keypoint) const {
  keypoint.x *= x_scale;
  keypoint.y *= y_scale;
  keypoint.scale *= std::sqrt(x_scale * y_scale);
  return keypoint;
}

double SmallerRatio(cv::Size image, int max_side_px) {
  return std::min(1.0, static_cast<double>(max_side_px) / std::max(image.width, image.height));
}

std::optional<SmallerImage> MakeSmaller(const cv::Mat& grey, const cv::Mat& mask, int max_side_px) {
  const double ratio = SmallerRatio(grey.size(), max_side_px);
  if (ratio == 1) return std::nullopt;
  const cv::Size size(std::max(1, cvRound(ratio * grey.cols)), std::max(1, cvRound(ratio * grey.rows)));
  SmallerImage smaller;
  cv::resize(grey, smaller.grey, size, 0, 0, cv::INTER_AREA);
  if (!mask.empty()) cv::resize(mask, smaller.mask, size, 0, 0, cv::INTER_NEAREST);
  smaller.x_scale = static_cast<float>(grey.cols) / static_cast<float>(size.width);
  smaller.y_scale = static_cast<float>(grey.rows) / static_cast<float>(size.height);
  return smaller;
}

Status CheckGreyImage(const cv::Mat& grey, const char* what) {
  if (!grey.empty() && grey.type() == CV_8UC1) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{} needs an 8-bit grey image, found {} x {} of OpenCV type {}", what, grey.cols,
                   grey.rows, grey.type());
}

Status CheckMask(const cv::Mat& mask, const cv::Mat& grey) {
  if (mask.empty() || (mask.size() == grey.size() && mask.type() == CV_8UC1)) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "a mask of {} x {} px does not fit the image of {} x {} px",
                   mask.cols, mask.rows, grey.cols, grey.rows);
}

}  // namespace cairn
