#pragma once

#include <vector>

#include "stages/group_classes/adjust/bundle.h"

namespace cairn::group_classes {

// Per image: sum of the squared errors of keypoints that were left out of an adjustment, in units of their
// variances, each cut off where outliers begin.
using LeftOutErrors = std::vector<double>;

// Adjusts the problem without one keypoint of each point of four or more, and asks how well these are
// predicted. Always leaves out the same ones.  REQUIRES: observations in the order of their points
LeftOutErrors LeaveOut(const BundleOptions& options, BundleProblem problem);

// By which part the errors are smaller after a change than before, and the standard error of that over
// images.
struct LeftOutGain {
  double part = 0;
  double standard_error = 0;
};

// Over the images of one camera; -1: over all.
LeftOutGain GainOf(const BundleProblem& problem, const LeftOutErrors& before, const LeftOutErrors& after,
                   int camera_idx);

}  // namespace cairn::group_classes
