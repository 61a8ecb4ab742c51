#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "stages/link_appearance/dominating_set/domination.h"

namespace cairn::link_appearance {

// Lower bound on the size of a connected dominating set, which shows how good a set is.
struct ConnectedBoundOptions {
  // "counting" (counting_bound.h), "program" (an integer program in addition), "none", or "auto": program for
  // components of at most max_num_program_links, else counting.
  std::string lower_bound = "auto";
  // auto: most links of a component that gets a program.  REQUIRES: >= 0
  int max_num_program_links = 1000;
  // Most rounds of cuts before branching.  REQUIRES: >= 0
  int max_num_cut_rounds = 60;
  // Most parts of the search; 0: the linear program alone.  REQUIRES: >= 0
  int max_num_branches = 200;
};

struct ConnectedBound {
  int lower_bound = 0;           // 0: not computed
  std::vector<NodeIdx> smaller;  // a smaller set than the given one, where the search found one; ascending
};

// Bounds the size of every connected set that meets the demands of a component.  `kept` is such a set: the
// search for a bound ends where it proves that there is no smaller one.
//
// The program: a set D is the nodes of a tree.  x_v: node v is in D; y_e: link e is in the tree.
//   min x(V)   such that
//   y(E) = x(V) - 1                       a tree has one link less than nodes
//   y(E(S)) <= x(S) - x_k   for k in S    and no cycle: its links in S are fewer than its nodes in S,
//   y(E(S)) <= x(S) - 1     for S that holds a node and all its neighbours: D meets it [Simonetti11 §2]
//   sum of w_uv x_u over neighbours + demand_v x_v >= demand_v                (domination.h)
//   x(N(v)) >= 1            where one node does not dominate all: D meets N(v), as otherwise v's neighbour
//                           would be cut off
//   x binary, y >= 0.
// Constraints are added for the sets S that the linear program's solutions violate (tree_cuts.h), at the root
// and in each part of a best-first search that fixes nodes.  Its bounds are proved in whole numbers
// (linear_program.h).  Links matter: two linked nodes dominate their common neighbours twice,
// so that this bound is well above that of domination or of separating node sets alone.  Where one dominator
// suffices and all links count alike (m = 1), a node whose neighbours are all neighbours of another one is
// left out.
//
// `progress` (may be null) can cancel it.  The bound is valid wherever it stops.  It stops by counts, not by
// time: same input, same bound.
ConnectedBound BoundConnectedSet(const Domination& domination, const std::vector<NodeIdx>& kept,
                                 const ConnectedBoundOptions& options, Progress* progress = nullptr);

}  // namespace cairn::link_appearance
