#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/camera.h"
#include "core/pose.h"

namespace cairn {

// An image as pair selection sees it.
struct PosedCamera {
  Camera camera;
  Pose cam_from_world;
};

struct FrustumOverlapOptions {
  // Distances at which the scene may lie, metres: the ends of the frustum that is sampled.  REQUIRES: 0 <
  // near < far
  double near_m = 0.6;
  double far_m = 6.0;
  // Least part of the samples of either frustum that the other camera sees.  REQUIRES: in [0, 1]
  double min_overlap_ratio = 0.15;
  // Largest angle between the two rays to a sample, degrees: SIFT does not match beyond.  REQUIRES: in (0,
  // 180]
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
// Image indices in the natural order of their names: digits compare by value ("2.jpg" before "10.jpg").
std::vector<int> NaturalOrder(const std::vector<std::string>& names);
// Each image with its `window` successors in `order`, a permutation of the image indices.
IndexPairs SequencePairs(const std::vector<int>& order, int window);
// Pairs of which either frustum overlaps the other by min_overlap_ratio.  O(images^2), on `num_threads`
// threads.
IndexPairs FrustumPairs(const std::vector<PosedCamera>& images, const FrustumOverlapOptions& options,
                        int num_threads);

}  // namespace cairn
