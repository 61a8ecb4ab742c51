#pragma once

#include <functional>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/ids.h"
#include "core/geometry/pose.h"
#include "stages/reconstruct/globally/agreeing_pieces.h"
#include "stages/reconstruct/view_graph/view_pairs.h"

namespace cairn::reconstruct {

// A point as two images have it: two points of a map that a match says are one.
struct SharedPoint {
  int image1 = 0, image2 = 0;
  Eigen::Vector3d in1 = Eigen::Vector3d::Zero(), in2 = Eigen::Vector3d::Zero();
};

// How the pair of two images says that the first's surroundings are turned from the second's.
struct SharedTurn {
  int image1 = 0, image2 = 0;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  // of points near the second
};

// What pairs say of a map that is there, whether they agree with it or not.
struct PairEvidence {
  std::vector<SignedLink> links;    // the number of matches; negative of pairs that do not agree
  std::vector<SharedTurn> turns;    // also by the other rotations that explain a pair's matches
  std::vector<SharedPoint> points;  // of some 60 matches of a pair
};

// The point that an image's keypoint sees; null: none.
using PointOf = std::function<const Eigen::Vector3d*(int image, KeypointIdx keypoint)>;

// Pairs are of indices into `cams_from_world`.  O(pairs).
PairEvidence EvidenceOf(const std::vector<ViewPair>& pairs, const std::vector<bool>& agrees,
                        const std::vector<Pose>& cams_from_world, const PointOf& point_of);

}  // namespace cairn::reconstruct
