#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/colmap/colmap_database.h"
#include "core/features/features.h"
#include "core/geometry/pose.h"
#include "stages/match_features/two_views/guided_match.h"

namespace cairn::match_features {

struct VerifyPairOptions {
  // "five_point": by stated poses where there are any, else five points or seven; "eight_point": normalised
  // eight points and RANSAC, whether poses are stated or not [Booij06 §III], for comparison.
  std::string two_view = "five_point";
  // Largest distance of an inlier to its epipolar line, pixels (Sampson distance; as an angle: over the mean
  // focal length).  REQUIRES: > 0
  double max_epipolar_error_px = 2.0;
  // Largest distance of an inlier of a homography from where that puts it, pixels (COLMAP: 4).  REQUIRES: > 0
  double max_homography_error_px = 4.0;
  // With known poses: matches farther than this from the epipolar line of the stated poses are dropped before
  // the relative pose is refined, pixels; as large as the errors of the poses.
  // REQUIRES: >= max_epipolar_error_px
  double max_prior_error_px = 16.0;
  // With known poses: largest angle between the two rays of a match, degrees; a surface is not seen from both
  // sides, and SIFT does not match beyond.  REQUIRES: in (0, 180]
  double max_ray_angle_deg = 90;
  // With known poses: a shorter baseline counts as zero, metres.  REQUIRES: > 0
  double min_baseline_m = 1e-3;
  // Fewest inliers of a verified pair.  REQUIRES: >= 8
  int min_num_inliers = 15;
  // With more than this part of its inliers on one homography a pair is planar or panoramic (COLMAP: 0.8).
  double min_homography_ratio = 0.8;
  // An essential matrix with fewer inliers than this part of the fundamental matrix's shows that the
  // intrinsics are wrong: the pair counts as uncalibrated (COLMAP: 0.95).
  double min_essential_ratio = 0.95;
  // A watermark: at least this part of the inliers lies on the border of both images and keeps its place up
  // to one shift (COLMAP: 0.7), ...
  double min_watermark_ratio = 0.7;
  // ... the border being as wide as this part of the diagonal (COLMAP: 0.1).
  double watermark_border_ratio = 0.1;
  // Which pairs are matched again along the epipolar lines of the geometry found: "posed": those whose stated
  // poses confirm the geometry, "all", or "none".  A wrong geometry found from matches alone would gain more
  // wrong matches.
  std::string guided_matching = "posed";
  GuidedMatchOptions guided;
};

// Pose of camera 2 in the frame of camera 1, where both are stated.  Verification uses poses only through it.
std::optional<Pose> StatedRelativePose(const std::optional<Pose>& cam1_from_world,
                                       const std::optional<Pose>& cam2_from_world);

// One image of the pair: camera, keypoints, and its stated pose if there is one.
struct ViewForVerification {
  const Camera* camera = nullptr;
  const PooledVector<Keypoint>* keypoints = nullptr;
  // Unit vector in the camera frame of every keypoint, NaN where undefined.
  const std::vector<Eigen::Vector3d>* bearings = nullptr;
  // Null: no guided matching.
  const DescriptorMatrix* descriptors = nullptr;
  DescriptorSpace space;
  std::optional<Pose> cam_from_world;
};

// Keeps the putative matches that one geometry explains, on bearings, hence for any field of view:
// - both poses known: essential matrix refined from the stated relative pose by iteratively reweighted
//   Gauss-Newton on the Sampson distance (no sampling), after dropping what the stated pose excludes: matches
//   off the epipolar lines, seen from more than max_ray_angle_deg apart, or that meet behind a camera.  The
//   last two are what looks alike in different places: views back to back have epipolar lines, too.
//   kPanoramic where no baseline is stated or a rotation alone explains the inliers, kPlanar where a
//   homography does.
// - poses unknown, intrinsics known (Camera::has_focal_prior of both): essential matrix by USAC, refined;
//   configuration as COLMAP 3.8 decides it from the inliers of E, F and H
//   (src/estimators/two_view_geometry.cc there): kCalibrated, kUncalibrated (E explains too little of what F
//   does), kPlanarOrPanoramic.  Differs from it: inliers are those of E also where F has more, so that they
//   obey the known intrinsics.
// - two_view = "eight_point", in place of all that: eight points (core/geometry/estimate_two_view.h), poses
//   not read; kCalibrated or, where a focal length is guessed, kUncalibrated.
// - focal length guessed: fundamental matrix by USAC; kUncalibrated or kPlanarOrPanoramic.
// Then guided matching adds what the geometry allows (guided_match.h).
//
// Result: configuration; inliers ascending, all of them within the options' error of the geometry; E on
// normalised coordinates, F and H on pixels, zero where not estimated (E of uncalibrated pairs; E and F where
// no baseline is stated).  F and H hold for cameras without distortion: they are K2^-T E K1^-1, K2 H K1^-1.
// Without inliers: kDegenerate (fewer than asked for) or kWatermark.  Deterministic.
// O(matches), O(n log n + candidates) with guided matching of n keypoints.
TwoViewGeometry VerifyPair(const ViewForVerification& view1, const ViewForVerification& view2,
                           std::span<const Match> matches, const VerifyPairOptions& options);

}  // namespace cairn::match_features
