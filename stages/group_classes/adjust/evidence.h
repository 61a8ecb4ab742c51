#pragma once

#include <span>

#include <Eigen/Core>

#include "core/structure/schur_system.h"

namespace cairn::group_classes {

// The normal equations of a bundle adjustment with its points eliminated, at its optimum: the inverse of
// their matrix is the covariance of everything else.
class ReducedSystem {
 public:
  // A row of a residual.
  struct Row {
    int residual = 0, row = 0;
  };

  // At the problem's values.
  ReducedSystem(const SchurProblem& problem, int num_threads);

  bool ok() const { return is_solved_; }
  // Its value, whitened.
  double ValueOf(const Row& row) const { return system_.terms().Residual(row.residual)[row.row]; }

  // trace(J H^-1 J') over rows that no point has, by 16 vectors of random signs [Hutchinson 1990]: of so many
  // of the residuals, as many are determined by themselves.  REQUIRES: ok()
  double Trace(std::span<const Row> rows) const;

  // Covariance of a block's parameters, in tangent space.  REQUIRES: ok(); a free block
  Eigen::MatrixXd Covariance(int block) const;

 private:
  int num_threads_;
  SchurSystem system_;
  bool is_solved_ = false;
};

}  // namespace cairn::group_classes
