#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// Images that pairs join: lists of indices, ascending, the largest first (ties: the one of the smallest
// index). Images without a pair are in none.
std::vector<std::vector<int>> ConnectedParts(int num_images, const std::vector<ViewPair>& pairs);

// Rotations along the tree of the pairs of most weight.  Every other pair has less than all between its
// images.
std::vector<Eigen::Quaterniond> RotationsAlongTree(int num_images, const std::vector<ViewPair>& pairs);

struct AverageRotationsOptions {
  // A pair whose rotation differs by more from that between its images' is wrong, degrees.  REQUIRES: > 0
  double max_error_deg = 5;
  // Scales beyond which a pair's error counts little, degrees, one after the other: of two pairs that
  // contradict each other by a few degrees one wins in the end.
  std::vector<double> robust_scales_deg = {5, 2, 1};
  int max_num_iterations = 30;  // with each scale
};

// Rotations cam_from_world of images that explain the pairs' best, robustly: along a tree of the pairs with
// most matches, then iteratively reweighted least squares on the sphere, by absolute values first, then by
// Geman and McClure's [Chatterjee & Govindu, "Efficient and robust large-scale rotation averaging", ICCV
// 2013].  Up to one rotation of the world.  REQUIRES: the pairs join all images.  O(iterations * sparse
// factorisation).
std::vector<Eigen::Quaterniond> AverageRotations(int num_images, const std::vector<ViewPair>& pairs,
                                                 const AverageRotationsOptions& options);

// How far a pair's rotation, or the nearest of those that explain it as well, is from that between its
// images, degrees.
double RotationErrorDeg(const ViewPair& pair, const std::vector<Eigen::Quaterniond>& rotations);

}  // namespace cairn::reconstruct
