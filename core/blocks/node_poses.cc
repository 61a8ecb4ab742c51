#include "core/blocks/node_poses.h"

#include "core/promise/promise_nodes.h"

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

}  // namespace cairn
