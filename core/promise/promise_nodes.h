#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/pose.h"
#include "core/promise/view_distance.h"
#include "core/world/feature_class.h"

namespace cairn {

// Where robots will look from: a place and a heading.
struct PromiseNode {
  Pose cam_from_world;
  // Positions in Classes::images: the survey image taken there, or the two between whose headings it lies
  // half way or at another even part.  Equal: the image itself.
  int32_t image = 0;
  int32_t other_image = 0;
};

// Where the `part`-th of `num_parts` equal steps of the turn from `a` to `b` looks, half way between their
// places.
Pose PoseBetween(const Pose& a, const Pose& b, int part, int num_parts);

// To find the nodes near a pose.
ViewTree TreeOf(const std::vector<PromiseNode>& nodes, double radius_m, double radius_deg);

// A node answers for robots this many views' radii around it.
inline constexpr double kNodeReach = 1.5;

// Views lie this many radii apart.
inline constexpr double kViewSpacing = 0.5;
// Those of these images (ascending) that lie apart, so that every one is within `spacing` radii of one of
// them; ascending.
std::vector<int32_t> ImagesApart(const ViewDistance& distance, const std::vector<int32_t>& images,
                                 double spacing);

// Images that lie apart, and, where the survey looked several ways from one place (lattices), headings
// between two neighbouring ones that see some of the same: a robot looks any way.  Of these images,
// ascending.  O(images log images), and the squares of the numbers taken at one place.
std::vector<PromiseNode> PromiseNodes(const Classes& classes, const ViewDistance& distance,
                                      const std::vector<int32_t>& of_images);

}  // namespace cairn
