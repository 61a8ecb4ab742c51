#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/features.h"

namespace cairn {

// What the ambiguity rule knows of a class: centre of its descriptors, its radius (root mean square angle
// between its descriptors and the centre, radians), its place, and how many keypoints it has.
struct ClassAppearance {
  Eigen::Matrix<uint8_t, 1, kDescriptorDim> centre;
  double radius_rad = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int num_observations = 0;
};

// Mean of RootSIFT descriptors, renormalised to norm 512 and quantised, and the radius about it.
void DescribeClass(const std::vector<const uint8_t*>& descriptors, ClassAppearance* appearance);

struct FindAmbiguousOptions {
  // Two classes are told apart when their centres lie farther apart than this many times the larger of their
  // radii [Sala06 §VI-B: "not significantly larger than the radius of the classes"].  REQUIRES: >= 0; 0
  // switches it off
  double min_separation_ratio = 1.0;
  // Classes that look alike and lie closer together than this are one scene feature found twice: the one with
  // more keypoints stays, metres.  REQUIRES: >= 0
  double max_duplicate_distance_m = 0.05;
};

enum class Ambiguity : uint8_t { kNone, kAmbiguous, kDuplicate };

// Per class.  The nearest other class of each is found exactly; O(n^2) dot products.
std::vector<Ambiguity> FindAmbiguous(const std::vector<ClassAppearance>& classes,
                                     const FindAmbiguousOptions& options);

}  // namespace cairn
