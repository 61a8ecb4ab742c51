#pragma once

#include <cmath>
#include <vector>

#include "stages/group_classes/adjust/bundle.h"

namespace cairn::group_classes {

// How wrong keypoints are, as their residuals after an adjustment show.
struct KeypointNoise {
  // Standard deviation of a coordinate: hypot(sigma_px, sigma_per_scale * the keypoint's scale), px.
  double sigma_px = 1;
  double sigma_per_scale = 0;
  // Which part of a keypoint's variance it shares with the others of its image: a rolling shutter, what is
  // left of the lens, blur.  It does not average out: n keypoints say as much as n / (1 + n * correlation /
  // 2) independent ones.
  double correlation = 0;

  double SigmaPx(double scale) const { return std::hypot(sigma_px, sigma_per_scale * scale); }
  // How many times as large as for independent keypoints the covariance of an image's pose is.
  double Dispersion(double num_keypoints) const { return 1 + 0.5 * num_keypoints * correlation; }
};

// `scales`: per observation, of its keypoint, px.  Standard deviations: from the medians of squared residuals
// of eight classes of scale.  Correlation: each image is placed by its left and by its right half, and by its
// upper and its lower one, with the points fixed; where errors are independent, the squared difference of two
// such poses in units of its covariance is 6 on average, and it grows with n where they are not.  Measured
// over images whose halves have at least 20 keypoints; 0 with fewer than 8 such.
KeypointNoise MeasureKeypointNoise(const BundleProblem& problem, const std::vector<double>& scales);

}  // namespace cairn::group_classes
