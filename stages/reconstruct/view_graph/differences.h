#pragma once

#include <vector>

#include <Eigen/Core>

namespace cairn::reconstruct {

// Two nodes of a graph, of whose values the difference is known.
struct Link {
  int from = 0, to = 0;
  double sigma = 1;   // standard deviation of the difference, per column.  REQUIRES: > 0
  double weight = 1;  // beside links that contradict it.  REQUIRES: > 0
};

// The nodes' values, a row each, the first node's zero, with the least sum of
//   weight * |value(to) - value(from) - difference|^2.
// Zero for all where the links do not join all nodes.  O(sparse factorisation).
Eigen::MatrixXd SolveDifferences(int num_nodes, const std::vector<Link>& links,
                                 const Eigen::MatrixXd& differences, const std::vector<double>& weights);

// The same by the links' standard deviations and weights, robustly, by iteratively reweighted least squares:
// absolute values first, then Geman and McClure's.
Eigen::MatrixXd SolveDifferencesRobustly(int num_nodes, const std::vector<Link>& links,
                                         const Eigen::MatrixXd& differences);

}  // namespace cairn::reconstruct
