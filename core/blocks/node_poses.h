#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/blocks/map_rows.h"
#include "core/geometry/pose.h"

namespace cairn {

// cam_from_world of the nodes of the map's promise, in their order.  REQUIRES: rows.findings.promise
std::vector<Pose> NodePoses(const MapRows& rows);

// The node whose view is nearest to a pose, and the square of its distance in the promise's radii; of equally
// near ones the first.  Nothing without nodes.  `poses`: NodePoses.
struct NearestNode {
  size_t node = 0;
  double squared_distance = 0;
};
std::optional<NearestNode> FindNearestNode(const MapPromise& promise, const std::vector<Pose>& poses,
                                           const Pose& cam_from_world);

}  // namespace cairn
