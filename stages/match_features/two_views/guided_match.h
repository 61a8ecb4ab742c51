#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/pooled.h"
#include "core/features/features.h"

namespace cairn::match_features {

struct GuidedMatchOptions {
  // Largest ratio of the angles to a match's best and second best descriptor among the keypoints that the
  // geometry allows, in both directions.  REQUIRES: in (0, 1]
  double max_ratio = 0.8;
  // Largest angle between matched descriptors, radians.  REQUIRES: > 0
  double max_angle_rad = 0.45;
  // Keypoints change scale and orientation from one image to the other roughly as those of the inliers do:
  // largest factor of the scale over their median, and largest angle from their mean.  REQUIRES: >= 1, > 0
  double max_scale_ratio = 1.5;
  double max_turn_deg = 30;
};

// What guided matching reads of one image: row i of `descriptors` and bearing i (unit, NaN where there is
// none) belong to keypoint i.
struct GuidedView {
  const PooledVector<Keypoint>* keypoints = nullptr;
  const std::vector<Eigen::Vector3d>* bearings = nullptr;
  const DescriptorMatrix* descriptors = nullptr;
  DescriptorSpace space;
};

// Matches again where the geometry of two views is known: each keypoint without a match looks for its best
// descriptor among the keypoints near its epipolar line; mutual best and ratio test, as before.  The many
// look-alikes elsewhere in the image, over which the ratio test of blind matching fails, no longer count.
// With few candidates the ratio test is weak: a match must also change scale and orientation as the
// inliers do.
//
// `M` is an essential or fundamental matrix on bearings (b2' M b1 = 0), `inliers` are matches that obey it.
// Keypoints of the second image are sorted by the angle of their epipolar plane about the baseline, in
// classes of their distance to the epipole, so that a keypoint meets only its few candidates: O(n log n +
// candidates).  Only candidates on the same side of the baseline count: points before both cameras.  Result:
// `inliers` and the new matches, ascending; all with a Sampson error of at most max_error_rad.
std::vector<Match> GuideByEpipolarLines(const GuidedView& view1, const GuidedView& view2,
                                        const Eigen::Matrix3d& M, double max_error_rad,
                                        const std::vector<Match>& inliers, const GuidedMatchOptions& options);

// The same for a homography on bearings (b2 ~ H b1): candidates lie within max_error_rad of where H takes the
// keypoint of the first image.
std::vector<Match> GuideByHomography(const GuidedView& view1, const GuidedView& view2,
                                     const Eigen::Matrix3d& H, double max_error_rad,
                                     const std::vector<Match>& inliers, const GuidedMatchOptions& options);

}  // namespace cairn::match_features
