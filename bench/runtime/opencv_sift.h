#pragma once

#include <malloc.h>

#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>

#include "core/features/sift.h"

namespace cairn {

// OpenCV's SIFT as its users have it at its best: one thread, with our options, its memory kept from image to
// image (else the system would clear its pages each time).  The process keeps all memory from then on.
inline cv::Ptr<cv::SIFT> OpenCvSift() {
  cv::setNumThreads(1);
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  const SiftOptions options;
  return cv::SIFT::create(options.max_num_features, 3, options.contrast_threshold, options.edge_threshold,
                          1.6, CV_32F);
}

}  // namespace cairn
