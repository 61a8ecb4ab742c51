#pragma once

#include <optional>
#include <vector>

#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"

namespace cairn::emit_map {

// How much wider than its normal matrix says the covariance of a fix of n inliers is:
// covariance_scale * (1 + n / 2 * keypoint_correlation).
struct FixNoise {
  double covariance_scale = 1;
  double keypoint_correlation = 0;
};

// By how much fixes of so many inliers were wider off, squared.
struct FixFactor {
  double num_inliers = 0;
  double factor = 1;
};
// The line through them, in which each counts as its number of inliers; neither part is negative, and the
// scale at least one.  Three decimals of the scale, five of the correlation: maps are to be small.  REQUIRES:
// not empty
FixNoise FitFixNoise(const std::vector<FixFactor>& factors);

// Measured by left-out runs: of twelve successive survey images the landmarks are placed anew by all others,
// and each of the twelve is placed by these landmarks as a robot's image is (RefinePoseWithCovariance).  Its
// error beside its pose in the map, squared in units of its covariance, lies below 10.64 (chi-square of 6
// degrees of freedom) for nine images in ten, if the covariance is right: the factor is what makes it so, a
// line over n through all keypoints of the images, every fourth and every sixteenth.  At most 40 runs, spread
// over the survey.  What no image shows is not in it: errors that an image and its neighbours share.  Nothing
// where fewer than three runs or twenty images can be tried.  Pure; same result for any number of threads.
// O(observations).
std::optional<FixNoise> LearnFixNoise(const Classes& classes, const MapRows& rows, int num_threads);

}  // namespace cairn::emit_map
