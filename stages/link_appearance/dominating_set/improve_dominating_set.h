#pragma once

#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "stages/link_appearance/dominating_set/domination.h"

namespace cairn::link_appearance {

struct ImproveOptions {
  // Number of tries to make the set smaller or, with a given size, better.  REQUIRES: >= 0
  int num_tries = 5000;
  // Most kept nodes that a try takes out.  REQUIRES: >= 1
  int max_num_taken_out = 8;
};

// Local search: takes a few neighbouring nodes out of the set, repairs it greedily by the shortfall and by
// the parts that are to be joined [Ruan04's potential], drops nodes that are no longer needed, and keeps the
// result where it is no worse.  `kept`: a connected dominating set (as GreedyDominatingSet's); the result has
// at most as many nodes, ascending.
//
// With `target_size` >= 0 `kept` has that many nodes and need not dominate: the result has as many, is
// connected, and its total shortfall is no larger.  `progress` (may be null) advances once per try; when it
// is cancelled, the best set so far is returned.  Same set for the same seed.  A try costs O(nodes + links of
// kept nodes).
std::vector<NodeIdx> ImproveDominatingSet(const Domination& domination, const std::vector<NodeIdx>& kept,
                                          const ImproveOptions& options, uint64_t seed, int target_size = -1,
                                          Progress* progress = nullptr);

}  // namespace cairn::link_appearance
