#pragma once

#include <vector>

#include "stages/link_appearance/dominating_set/domination.h"

namespace cairn::link_appearance {

// A small connected dominating set of each component, by the greedy algorithm of Guha and Khuller [Booij06
// §IV-B; Guha98, algorithm I]:
//   1. All nodes white.
//   2. Pick the white node with the most neighbours.
//   3. Colour it black, its white neighbours gray.
//   4. Pick the gray node with the most white neighbours.
//   5. Go to 3 until no white is left.
//   6. Black nodes = CDS.
// Ties go to the smallest node.  With other demands than the source's (domination.h) "white neighbours" means
// what the neighbours, and the node itself, still lack and the node would contribute.  Components take turns,
// the largest gain first: the result for each is the same as one after the other, and the first n nodes of
// the order are good for any n.
//
// `target_size`: stops at this many nodes; continues beyond domination, with one more dominator for each node
// at a time; -1: stops when all are dominated.  `start`: nodes that are kept already and come first; those of
// a component are connected.  Returns the nodes in the order in which they turned black; connected in each
// component at any length, unless `start` is not.  O(m links log nodes) time for m dominators, O(nodes)
// memory besides the graph.
std::vector<NodeIdx> GreedyDominatingSet(const Domination& domination, int target_size = -1,
                                         const std::vector<NodeIdx>& start = {});

}  // namespace cairn::link_appearance
