#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/features/features.h"

namespace cairn::group_classes {

// What the ambiguity rule reads of a class: centre of its descriptors, its radius (root mean square angle
// between its descriptors and the centre, radians), its place, and how many keypoints it has.
struct ClassAppearance {
  DescriptorRow centre = DescriptorRow::Zero(kSiftDescriptorDim);
  double radius_rad = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int num_observations = 0;
};

// Mean of descriptors, as one of them, and the radius about it.
void DescribeClass(const std::vector<const uint8_t*>& descriptors, const DescriptorSpace& space,
                   ClassAppearance* appearance);

struct FindAmbiguousOptions {
  // Two classes are told apart when their centres lie farther apart than this many times the larger of their
  // radii [Sala06 §VI-B: "not significantly larger than the radius of the classes"; there the distance
  // is that of two features, here that of the centres, so that one odd keypoint does not decide].
  // REQUIRES: >= 0; 0 switches it off
  double min_separation_ratio = 1.0;
  // Classes that look alike and lie closer together than this are one scene feature found twice: the one with
  // more keypoints stays, metres.  REQUIRES: >= 0
  double max_duplicate_distance_m = 0.05;
};

// kAmbiguous takes precedence over kDuplicate.
enum class Ambiguity : uint8_t { kNone, kAmbiguous, kDuplicate };

// Per class.  Every pair of classes is tested, not only the nearest ones: the nearest look-alike of a class
// may be its duplicate, and another one within a wide class's radius may have nearer neighbours.  Both
// classes of an ambiguous pair are dropped [Sala06 §VI-B: all features of both classes], also where only
// one's radius reaches the other.  Exact, whatever the order of the classes; O(n^2) dot products, by the
// kernels of core/features/descriptor_matcher.h, and more where look-alikes are dense.
std::vector<Ambiguity> FindAmbiguous(const std::vector<ClassAppearance>& classes,
                                     const DescriptorSpace& space, const FindAmbiguousOptions& options);

}  // namespace cairn::group_classes
