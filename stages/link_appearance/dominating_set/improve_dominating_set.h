#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "stages/link_appearance/dominating_set/domination.h"

namespace cairn::link_appearance {

struct ImproveOptions {
  // Tries at making the set smaller, or at a given size better.  REQUIRES: >= 0
  int num_tries = 5000;
  // Most kept nodes that a try takes out.  REQUIRES: >= 1
  int max_num_taken_out = 8;
};

// Local search: takes a few neighbouring nodes out of the set, repairs it greedily by what is missing and by
// the parts that are to be joined [Ruan04's potential], drops what is not needed any more, and keeps the
// outcome where it is no worse.  `kept`: a connected dominating set (as GreedyDominatingSet's); the result is
// one of at most as many nodes, ascending.
//
// With `target_size` >= 0 `kept` has that many nodes and need not dominate: the result has as many, is
// connected, and misses no more in all.
// `progress` (may be null) advances by a try; where it is cancelled, the best set so far comes back.
// Same set for the same seed.  A try costs O(nodes + links of kept nodes).
std::vector<NodeIdx> ImproveDominatingSet(const Domination& domination, const std::vector<NodeIdx>& kept,
                                          const ImproveOptions& options, uint64_t seed, int target_size = -1,
                                          Progress* progress = nullptr);

}  // namespace cairn::link_appearance
