#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// How far from an image's centre the point of one of its keypoints is.
struct PairDepth {
  KeypointIdx keypoint_idx = 0;
  double log_depth = 0;  // in lengths of the pair's way
};

// What a pair's own relative pose says of the points of its matches that it sees from sides different enough;
// nothing, if they are too few.
struct PairDepths {
  int image1 = 0, image2 = 0;
  std::vector<PairDepth> from1, from2;  // from each image's centre, ascending keypoint_idx
};

// `bearings1`, `bearings2`: of the pair's matches, unit vectors in the cameras' frames; `sigma_rad`: their
// standard deviation.
PairDepths DepthsOf(const ViewPair& pair, const std::vector<Eigen::Vector3d>& bearings1,
                    const std::vector<Eigen::Vector3d>& bearings2, double sigma_rad);

// What is known of a pair's length beforehand.
struct KnownLength {
  int pair = 0;
  double log_length = 0, sigma = 1;  // sigma: of the logarithm
};

// Lengths of the ways between the images of the pairs, in the unit of those that are known: two pairs of one
// image see the same points equally far from it, which gives the ratio of their lengths, and the lengths
// whose logarithms explain these best, robustly, are taken [after Cui & Tan, "Global structure-from-motion by
// similarity averaging", ICCV 2015, §4].  0 of a pair that shares no points with another, as of one that
// turns on the spot.
std::vector<double> PairLengths(int num_images, const std::vector<PairDepths>& pairs,
                                const std::vector<KnownLength>& known);

}  // namespace cairn::reconstruct
