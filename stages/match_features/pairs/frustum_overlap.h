#pragma once

#include <functional>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/camera/camera.h"
#include "core/geometry/pose.h"

namespace cairn::match_features {

// What pair selection reads of an image.
struct PosedCamera {
  Camera camera;
  Pose cam_from_world;
};

struct FrustumOverlapOptions {
  // Distances at which the scene may lie, metres: the ends of the frustum that is sampled.
  // REQUIRES: 0 < near < far
  double near_m = 0.6;
  double far_m = 6.0;
  // Smallest part of the samples of either frustum that the other camera sees.  REQUIRES: in [0, 1]
  double min_overlap_ratio = 0.15;
  // Largest angle between the two rays to a sample, degrees: SIFT does not match beyond.
  // REQUIRES: in (0, 180]
  double max_view_angle_deg = 60;
  // Largest ratio of the two distances to a sample.  REQUIRES: >= 1
  double max_scale_ratio = 3.5;
};

// Part of image 1's frustum samples that image 2 sees well enough to match, in [0, 1].
double FrustumOverlap(const PosedCamera& image1, const PosedCamera& image2,
                      const FrustumOverlapOptions& options);

// An image that another one's frustum overlaps; the overlap is the mean of both directions, in [0, 1].
struct OverlapPartner {
  int idx;
  float overlap;
};
// Takes the images that an image overlaps by min_overlap_ratio in either direction, largest mean overlap
// first, ties to the smaller index.
using TakeRanking = std::function<void(int idx, const std::vector<OverlapPartner>& partners)>;

// Ranks the partners of the images `idxs` and hands them to `take`, on any thread, each once.  Only images
// within reach of each other are looked at, each pair of these twice.  Memory: 150 bytes per image, 5 kB per
// camera. Errors: Cancelled.
Status RankOverlaps(const std::vector<PosedCamera>& images, const std::vector<int>& idxs,
                    const FrustumOverlapOptions& options, int num_threads, Progress& progress,
                    const TakeRanking& take);

}  // namespace cairn::match_features
