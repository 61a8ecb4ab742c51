#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/camera.h"
#include "core/colmap_database.h"
#include "core/features.h"
#include "core/pose.h"

namespace cairn {

struct VerifyPairOptions {
  // Largest Sampson distance of an inlier to its epipolar line, pixels.  REQUIRES: > 0
  double max_epipolar_error_px = 2.0;
  // With known poses: matches farther than this from the epipolar line of the stated poses are dropped before
  // the relative pose is refined, pixels; as wide as the poses are wrong.  REQUIRES: >= max_epipolar_error_px
  double max_prior_error_px = 16.0;
  // Fewest inliers of a verified pair.  REQUIRES: >= 8
  int min_num_inliers = 15;
  // A pair with at least this part of its inliers on one homography is planar or panoramic (COLMAP: 0.8).
  double min_homography_ratio = 0.8;
};

// One image of the pair: camera, keypoints, and its stated pose if there is one.
struct ViewForVerification {
  const Camera* camera = nullptr;
  const std::vector<Eigen::Vector2d>* rays =
      nullptr;  // normalised coordinates of every keypoint, NaN where undefined
  std::optional<Pose> cam_from_world;
};

// Keeps the putative matches that one relative pose explains.  Known intrinsics; essential matrix:
// - both poses known: refined from the stated relative pose by iteratively reweighted Gauss-Newton on the
// Sampson
//   distance (no sampling), after dropping what the stated pose excludes;
// - else: OpenCV's USAC (MAGSAC) five-point estimator with a fixed seed.
// Result: configuration, inliers (ascending) and E, F as COLMAP writes them; fewer inliers than asked for:
// kDegenerate and no inliers.
TwoViewGeometry VerifyPair(const ViewForVerification& view1, const ViewForVerification& view2,
                           const std::vector<Match>& matches, const VerifyPairOptions& options);

// Squared Sampson distance of a correspondence in normalised coordinates: x2' E x1 over its gradient.
double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);

}  // namespace cairn
