#include "stages/reconstruct/view_graph/differences.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SparseCholesky>

namespace cairn::reconstruct {
namespace {

constexpr int kNumByAbsolute = 10, kNumBySquares = 10;
// In standard deviations: errors below are not told apart, and those beyond count little.
constexpr double kLeastError = 0.1, kRobustScale = 3;

}  // namespace

Eigen::MatrixXd SolveDifferences(int num_nodes, const std::vector<Link>& links,
                                 const Eigen::MatrixXd& differences, const std::vector<double>& weights) {
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(num_nodes, differences.cols());
  if (num_nodes < 2) return values;
  std::vector<Eigen::Triplet<double>> triplets;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(num_nodes - 1, differences.cols());
  const auto add = [&](int row, int column, double value) {
    if (row > 0 && column > 0) triplets.emplace_back(row - 1, column - 1, value);
  };
  for (size_t k = 0; k < links.size(); ++k) {
    const int a = links[k].from, b = links[k].to;
    const auto row = static_cast<Eigen::Index>(k);
    add(a, a, weights[k]);
    add(b, b, weights[k]);
    add(a, b, -weights[k]);
    add(b, a, -weights[k]);
    if (a > 0) right.row(a - 1) -= weights[k] * differences.row(row);
    if (b > 0) right.row(b - 1) += weights[k] * differences.row(row);
  }
  Eigen::SparseMatrix<double> laplacian(num_nodes - 1, num_nodes - 1);
  laplacian.setFromTriplets(triplets.begin(), triplets.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors(laplacian);
  if (factors.info() == Eigen::Success) values.bottomRows(num_nodes - 1) = factors.solve(right);
  return values;
}

Eigen::MatrixXd SolveDifferencesRobustly(int num_nodes, const std::vector<Link>& links,
                                         const Eigen::MatrixXd& differences) {
  std::vector<double> precisions, weights(links.size());
  for (const Link& link : links) precisions.push_back(link.weight / (link.sigma * link.sigma));
  Eigen::MatrixXd values = SolveDifferences(num_nodes, links, differences, precisions);
  for (int iteration = 0; iteration < kNumByAbsolute + kNumBySquares; ++iteration) {
    for (size_t k = 0; k < links.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      const double error =
          (values.row(links[k].to) - values.row(links[k].from) - differences.row(row)).norm() /
          links[k].sigma;
      weights[k] =
          precisions[k] * (iteration < kNumByAbsolute ? 1 / std::max(error, kLeastError)
                                                      : std::pow(1 + std::pow(error / kRobustScale, 2), -2));
    }
    values = SolveDifferences(num_nodes, links, differences, weights);
  }
  return values;
}

}  // namespace cairn::reconstruct
