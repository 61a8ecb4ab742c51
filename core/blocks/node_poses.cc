#include "core/blocks/node_poses.h"

#include "core/promise/promise_nodes.h"
#include "core/promise/view_distance.h"

namespace cairn {

std::vector<Pose> NodePoses(const MapRows& rows) {
  const std::vector<NodePromise>& nodes = rows.findings.promise->nodes;
  std::vector<Pose> poses;
  for (size_t i = 0; i < nodes.size();) {
    // Nodes between two headings follow each other.
    size_t end = i + 1;
    while (nodes[i].image != nodes[i].other_image && end < nodes.size() &&
           nodes[end].image == nodes[i].image && nodes[end].other_image == nodes[i].other_image)
      ++end;
    const Pose& a = rows.images[nodes[i].image].cam_from_world;
    const Pose& b = rows.images[nodes[i].other_image].cam_from_world;
    const int num_parts = static_cast<int>(end - i) + 1;
    for (int part = 1; part < num_parts; ++part)
      poses.push_back(nodes[i].image == nodes[i].other_image ? a : PoseBetween(a, b, part, num_parts));
    i = end;
  }
  return poses;
}

std::optional<NearestNode> FindNearestNode(const MapPromise& promise, const std::vector<Pose>& poses,
                                           const Pose& cam_from_world) {
  std::optional<NearestNode> nearest;
  for (size_t node = 0; node < poses.size(); ++node) {
    const double squared =
        ViewDistanceSquared(cam_from_world, poses[node], promise.radius_m, promise.radius_deg);
    if (!nearest || squared < nearest->squared_distance) nearest = {node, squared};
  }
  return nearest;
}

}  // namespace cairn
