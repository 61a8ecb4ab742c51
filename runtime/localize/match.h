#pragma once

#include <vector>

#include "core/geometry/pose.h"
#include "core/options/options.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"

namespace cairn {

struct MatchOptions {
  // Largest ratio of best to second-best descriptor angle, both ways.  REQUIRES: in (0, 1]
  double max_ratio = 0.85;
  // Largest angle between the descriptors of a match, radians.  REQUIRES: > 0
  double max_angle_rad = 0.8;

  // Guided by a first pose: a landmark is looked for within guided_radius_px of its projection and
  // guided_radius_sigmas standard deviations of its own position, projected; the two add as squares.  A
  // radius smaller than the errors that the landmarks' covariances predict would make the pose's covariance
  // too small.  REQUIRES: guided_radius_px > 0, guided_radius_sigmas >= 0
  double guided_radius_px = 10;
  double guided_radius_sigmas = 3;
  // Largest descriptor angle of a guided match, radians.  REQUIRES: > 0
  double guided_max_angle_rad = 0.7;
  // Largest ratio of the keypoint's scale to the one that the landmark's size predicts, or of its inverse.
  // REQUIRES: >= 1
  double guided_max_scale_ratio = 2.5;
  // Landmarks looked for are those of this many survey images, which share most inliers with the query; 0: no
  // guided matching.  REQUIRES: >= 0
  int guided_num_images = 12;
};
OptionTable DescribeOptions(MatchOptions* options);

// Correspondences between the query and these landmarks, by mutual nearest descriptors and ratio test,
// ascending by keypoint.  REQUIRES: landmarks.packed
std::vector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                           const MatchOptions& options);

// Landmarks that should be visible given these (ascending): those seen in the survey images that share most
// of them, ascending.  Errors: as Map::Landmarks.
Result<std::vector<LandmarkIdx>> CovisibleLandmarks(const Map& map, const std::vector<LandmarkIdx>& seen,
                                                    const MatchOptions& options);

// Correspondences of landmarks with keypoints near their projections at `cam_from_world`: per landmark the
// keypoint with the smallest descriptor angle, per keypoint the best such landmark.  Ascending by keypoint.
std::vector<Correspondence> MatchGuided(const Query& query, const LandmarkSet& landmarks,
                                        const Pose& cam_from_world, const MatchOptions& options);

}  // namespace cairn
