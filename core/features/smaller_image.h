#pragma once

#include <optional>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/features/features.h"

namespace cairn {

// An image, and its mask if it has one, made smaller before features are sought in it.  With pixels counted
// from the image's corner, a position in one is a multiple of that in the other.
struct SmallerImage {
  cv::Mat grey, mask;
  float x_scale = 1, y_scale = 1;  // of the whole image over this one

  // The keypoint in the whole image's pixels.
  Keypoint Larger(Keypoint keypoint) const;
};

// By how much an image is made smaller for its longer side to have so many pixels at most; at most 1.
double SmallerRatio(cv::Size image, int max_side_px);
// Nothing: the image is small enough.
std::optional<SmallerImage> MakeSmaller(const cv::Mat& grey, const cv::Mat& mask, int max_side_px);

// Errors: InvalidArgument (no 8-bit grey image, which `what` needs; a mask that is none of its size).
Status CheckGreyImage(const cv::Mat& grey, const char* what);
Status CheckMask(const cv::Mat& mask, const cv::Mat& grey);

}  // namespace cairn
