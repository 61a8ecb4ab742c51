#pragma once

#include <cstdint>
#include <vector>

#include "core/features/features.h"

namespace cairn {

// Descriptors of one child of a split node, and its centre, of a descriptor's norm.
struct NodeChild {
  DescriptorRow centre;
  std::vector<int32_t> members;  // rows of `descriptors`, ascending
};

// Splits `members` (rows of `descriptors`) into at most `branching` clusters by k-means over directions:
// seeds far from each other (k-means++), then at most `max_num_iterations` rounds.  Clusters that end empty
// are pruned; no child at all when the members cannot be split (all equal in direction).  Members are copied
// together, unless they are all rows.  REQUIRES: members ascending, each once
std::vector<NodeChild> SplitNode(const DescriptorMatrix& descriptors, const DescriptorSpace& space,
                                 const std::vector<int32_t>& members, int branching, int max_num_iterations,
                                 uint64_t seed, int num_threads);

}  // namespace cairn
