#pragma once

#include <cstdint>
#include <functional>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/features/features.h"
#include "core/options/options.h"

namespace cairn {

// SIFT with RootSIFT descriptors (core/sift).  The same function serves the survey and a robot's query.
struct SiftOptions {
  // Most features per image; the strongest are kept.  REQUIRES: in [1, 1000000]
  int max_num_features = 2000;
  // Images with a longer side are made smaller before, and their keypoints larger again: the pyramid takes
  // about 75 bytes for each pixel (580 MB for 3200 x 2400 px) in every thread [COLMAP: 3200].
  // REQUIRES: in [64, 65536]
  int max_image_side_px = 3200;
  // Least contrast of an extremum times the layers (OpenCV's contrastThreshold); where the brightest tenth of
  // an image begins between grey levels 5 and 80, (level / 80)^2 of it, a tenth at least: with a tenth of the
  // light nothing is above OpenCV's (bench/features).  REQUIRES: in [0, 1]
  double contrast_threshold = 0.02;
  // Largest ratio of principal curvatures (edges).  REQUIRES: >= 1
  double edge_threshold = 10;
};
OptionTable DescribeOptions(SiftOptions* options);

// Features of an 8-bit grey image, ordered by (y, x, scale, orientation): the same bits on every processor.
// `mask`, if not empty, has the image's size; features at zero pixels are dropped.  A blank or tiny image
// gives no features, not an error.  Errors: InvalidArgument for an image or mask of another type or size.
Result<Features> ExtractSift(const cv::Mat& grey, const SiftOptions& options, const cv::Mat& mask = {});

// Scales of features, in octaves of their own: above and below CoarseSiftScalePx, or both.
enum class SiftScales { kCoarse, kFine, kAll };
// Pixels of an image, as it is when features are sought.
int64_t NumSiftPixels(cv::Size image, const SiftOptions& options);
// Least scale of an image's coarse features, sigma, px of the image.
double CoarseSiftScalePx(cv::Size image, const SiftOptions& options);

// Features of these scales from the image's own pixels, not from the doubled image's (SiftSearch::doubled):
// as many of them show a map's landmarks as of ExtractSift's.  All take half of its time, the coarse ones a
// quarter, the fine ones about as much, and those of them that are not wanted a tenth.  Order and errors: as
// ExtractSift.
Result<Features> ExtractUndoubledSift(const cv::Mat& grey, const SiftOptions& options, SiftScales scales,
                                      const std::function<bool(const Keypoint&)>& is_wanted = {});

// OpenCV's keypoint position in COLMAP's pixels: half a pixel for the pixel's centre, minus the quarter that
// OpenCV 4.6's SIFT adds when it starts from the doubled image.
Keypoint KeypointFromOpenCv(float x, float y, float size, float angle_deg);

}  // namespace cairn
