#pragma once

#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/blocks/map_rows.h"
#include "core/world/appearance_graph.h"

namespace cairn {

// The appearance graph of a map's images, for finding ways from one to another (runtime/drive/route.h).
struct AppearanceMap {
  AppearanceGraph graph;                          // links with a kept node at one end
  std::vector<std::vector<int32_t>> node_images;  // per node, indices of images, ascending
  std::vector<char> is_kept;                      // per node
  std::vector<NodeIdx> node_of_image;             // per image of the map; -1: in no node
  int num_kept_images = 0;
  // How well each node's place can be told from others; empty where the map does not say.
  std::vector<double> entropy;                                         // nats
  std::vector<std::vector<MapAppearanceNode::LookAlike>> look_alikes;  // both ways, ascending by node
};

}  // namespace cairn
