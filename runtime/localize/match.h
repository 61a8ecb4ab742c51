#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "core/base/pooled.h"
#include "core/geometry/pose.h"
#include "runtime/localize/estimate.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/landmark_set.h"
#include "runtime/map/map.h"

namespace cairn {

// Correspondences between an image and these landmarks, by mutual nearest descriptors and ratio test,
// ascending by keypoint.  REQUIRES: landmarks.packed
PooledVector<Correspondence> MatchLandmarks(const Query& query, const LandmarkSet& landmarks,
                                            const MatchOptions& options);

// Landmarks that should be visible given these (ascending): those seen in the survey images that share most
// of them, ascending; of so many of these images that they are no more than max_num, or of one.  Errors: as
// Map::Landmarks.
Result<PooledVector<LandmarkIdx>> CovisibleLandmarks(const Map& map, std::span<const LandmarkIdx> seen,
                                                     const MatchOptions& options,
                                                     int64_t max_num = std::numeric_limits<int64_t>::max(),
                                                     WorkBudget* work = nullptr);

// Correspondences of landmarks with keypoints near their projections at a pose: per landmark and image the
// keypoint with the smallest descriptor angle, per keypoint the best such landmark.  Ascending by image, then
// by keypoint.
PooledVector<Correspondence> MatchGuided(const Sighting& sighting, const LandmarkSet& landmarks,
                                         const Pose& rig_from_world, const MatchOptions& options);

// What guided matching found, and the pose at which it looked.
struct GuidedMatches {
  PooledVector<Correspondence> matches;
  Pose cam_from_world;  // of a rig: rig_from_world
};

// A first pose of few matches may be too far off for some landmarks to be found, and what lies near a wrong
// pose by chance confirms it.  Where fewer than guided_sure_num_inliers led to it, they are looked for
// guided_widest times as far from their projections, and a pose is estimated anew from what is there; then
// half as far, and so on; the pose at which MatchGuided finds most stays.  Then what it finds refines the
// pose (RefinePose), and they are looked for again there, as long as that finds more.
GuidedMatches MatchGuidedInRounds(const Sighting& sighting, const LandmarkSet& landmarks,
                                  const PoseEstimate& first, const MatchOptions& options,
                                  const EstimateOptions& estimate_options,
                                  const RefineOptions& refine_options);

// How many MatchGuided finds where there is nothing to be found: the mean over four ways of looking for each
// landmark beside its projection, four times as far off as it is looked for at all.
double GuidedByChance(const Sighting& sighting, const LandmarkSet& landmarks, const Pose& rig_from_world,
                      const MatchOptions& options);

}  // namespace cairn
