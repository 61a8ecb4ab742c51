#pragma once

#include <vector>

#include "core/blocks/map_rows.h"
#include "core/world/appearance.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/previous/match_previous.h"

namespace cairn::emit_map {

// Keeps the nodes that an earlier map kept (its appearance graph says which links a map stores: one other
// kept node, and those of all around it are others), and of those that the graph says are to be kept the ones
// that nodes lack without them: every node that has to be is dominated
// (stages/link_appearance/dominating_set: num_dominators, strong_num_inliers), and the kept ones of a
// component are connected.  A few more than the fewest.  Nothing where cycles are restored: which nodes these
// take is known to that stage alone. `was_kept`: per node.  O(links).
void KeepRoles(const std::vector<char>& was_kept, Appearance* appearance);

// Per node, whether the earlier map kept the node of its first image.
std::vector<char> WereKept(const Appearance& appearance, const Classes& classes, const MapRows& previous,
                           const PreviousMatches& matches);

}  // namespace cairn::emit_map
