#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Sparse>

namespace cairn::group_classes {

// The normal equations of a bundle adjustment with its points eliminated, at its optimum: the inverse of
// their matrix is the covariance of everything else.
class ReducedSystem {
 public:
  // `jacobian`: whitened; its first 3 * num_points columns are those of points.  Dense, of as many rows as
  // there are other columns: for some hundred images.
  ReducedSystem(const Eigen::Ref<const Eigen::SparseMatrix<double, Eigen::RowMajor>>& jacobian,
                int num_points);

  bool ok() const { return factors_.info() == Eigen::Success; }

  // trace(J H^-1 J') over rows of the jacobian that have no point, by 16 vectors of random signs
  // [Hutchinson 1990]: of so many of the residuals, as many are determined by themselves.
  double Trace(const std::vector<int>& rows) const;

  // Covariance of `size` parameters from column `first` (counted behind the points').
  Eigen::MatrixXd Covariance(int first, int size) const;

 private:
  Eigen::SparseMatrix<double, Eigen::RowMajor> others_;  // columns behind the points'
  Eigen::LLT<Eigen::MatrixXd> factors_;
};

}  // namespace cairn::group_classes
