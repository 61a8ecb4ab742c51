#pragma once

#include <string>
#include <utility>
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

// Index pairs (i < j), ascending.
using IndexPairs = std::vector<std::pair<int, int>>;
IndexPairs ExhaustivePairs(int num_images);
// Each image with its `window` successors in `order`, a permutation of the image indices.
IndexPairs SequencePairs(const std::vector<int>& order, int window);

// An image that another one's frustum overlaps; the overlap is the mean of both directions, in [0, 1].
struct OverlapPartner {
  int idx;
  float overlap;
};
using OverlapRanking = std::vector<std::vector<OverlapPartner>>;  // of each image
// The images that each image overlaps by min_overlap_ratio in either direction, largest mean overlap first,
// ties to the smaller index.  O(images^2), but only the distance is computed for pairs out of reach of each
// other.  Errors: Cancelled.
Result<OverlapRanking> RankOverlaps(const std::vector<PosedCamera>& images,
                                    const FrustumOverlapOptions& options, int num_threads,
                                    Progress& progress);

// Each image with all its partners.
IndexPairs FrustumPairs(const OverlapRanking& ranking);
// Each image with the first `num_best` of its partners and with `num_spread` evenly spaced in the ranks of
// the others: the first may all be of one pass along a path, the others find the passes before and after.
IndexPairs FrustumSeeds(const OverlapRanking& ranking, int num_best, int num_spread);

// Pairs (i, j) of which one is among the partners of the other, i < j, ascending, each once.
IndexPairs PairsFromPartners(const std::vector<std::vector<int>>& partners);

}  // namespace cairn::match_features
