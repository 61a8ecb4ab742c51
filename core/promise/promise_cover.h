#pragma once

#include <cstdint>
#include <vector>

#include "core/promise/expected_matches.h"

namespace cairn {

// The fewest classes such that every node expects as many matches as it demands:
//
//   min sum over i of x_i    so that, for every node v,  sum over i of p_iv x_i >= b_v,    x_i in {0, 1}
//
// p_iv = ExpectedMatch::probability, b_v = demand.  A node whose classes together cannot meet its demand
// demands what they can (Demands).
struct CoverProblem {
  // Per class, ascending nodes; `view` is the node.
  const std::vector<std::vector<ExpectedMatch>>* of_class = nullptr;
  std::vector<double> demands;  // per node, >= 0
};

// Demands `needed` where all classes together give it, else `reachable_ratio` of what they give.
std::vector<double> Demands(const std::vector<std::vector<ExpectedMatch>>& of_class, size_t num_nodes,
                            double needed, double reachable_ratio);

// Per node, the classes that it expects, ascending, with their probabilities.
using ClassesOfNodes = std::vector<std::vector<ClassMatch>>;

// CoverFast of these nodes alone, by the classes that they expect, at the cost of these.  Of `taken`
// (ascending) those are in it that one of the nodes expects.
std::vector<size_t> CoverNodes(const ClassesOfNodes& of_node, const std::vector<double>& demands,
                               const std::vector<int32_t>& nodes, const std::vector<size_t>& taken = {});

struct CoverOptions {
  int num_iterations = 500;  // of the lower bound
  int num_threads = 0;       // 0: all cores
};

struct LandmarkCover {
  std::vector<size_t> chosen;  // ascending
  // No cover has fewer: the bound of the linear relaxation's dual.
  int64_t lower_bound = 0;
};

// Adds classes to `taken` (positions, ascending; may be none) until all demands are met: the one that meets
// most of what is lacking first [Wolsey, "An analysis of the greedy algorithm for the submodular set covering
// problem", 1982], then those are taken out again that turned out not to be needed, but none of `taken`.
// O(sights log classes).  Ties: the smaller position.
std::vector<size_t> CoverFast(const CoverProblem& problem, const std::vector<size_t>& taken = {});

// The best of CoverFast and of covers that begin with the classes that pay at the prices of the dual
// (Lagrange multipliers by the subgradient method [Fisher, "The Lagrangian relaxation method for solving
// integer programming problems", 1981]), and the bound that these prices prove.  O(iterations * sights). Same
// result for any number of threads.
LandmarkCover CoverBest(const CoverProblem& problem, const CoverOptions& options);

}  // namespace cairn
