#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/structure/schur_problem.h"

namespace cairn {

// The residuals of a SchurProblem, and their Jacobians in tangent space.  All are evaluated at once on many
// threads, each into a place of its own.  Robust losses weigh both by sqrt(rho') [Triggs00 §4.3].
class SchurTerms {
 public:
  // Refers to the problem, whose structure and constant blocks stay as they are.
  SchurTerms(const SchurProblem& problem, int num_threads);

  const SchurProblem& problem() const { return problem_; }
  // Blocks that are not constant: points, and others.
  const std::vector<int>& points() const { return points_; }
  const std::vector<int>& others() const { return others_; }
  // Of a block among these; -1: it is constant.
  int index_of(int block) const { return index_[block]; }
  bool IsFreeOther(int block) const { return index_[block] >= 0 && !problem_.blocks()[block].is_point; }

  // What the problem's blocks hold: all values, block after block, and where a block's begin.
  std::vector<double> Values() const;
  void Store(const std::vector<double>& values) const;  // into the blocks
  size_t value_begin(int block) const { return value_begin_[block]; }

  // The sum; nothing where a cost cannot be evaluated, or is not finite.
  std::optional<double> Cost(const std::vector<double>& values) { return Evaluate(values, false); }
  // As Cost(), and what follows is about these values.
  std::optional<double> Linearize(const std::vector<double>& values);

  // Where a block is used.
  struct Use {
    int residual = 0, argument = 0;
  };
  std::span<const Use> UsesOfPoint(int point) const { return Uses(point); }
  std::span<const Use> UsesOfOther(int other) const { return Uses(points_.size() + other); }
  std::span<const int> BlocksOf(int residual) const {
    return problem_.BlocksOf(problem_.residuals()[residual]);
  }
  int NumRows(int residual) const { return problem_.residuals()[residual].cost->num_residuals(); }
  // Weighted.  The Jacobians of a residual by its free arguments follow it, one after the other, row by row.
  const double* Residual(int residual) const { return &jacobians_[jacobian_begin_[residual]]; }
  const double* Jacobian(const Use& use) const;

 private:
  void FindUses();
  std::span<const Use> Uses(size_t place) const {
    return std::span<const Use>(uses_).subspan(use_begin_[place], use_begin_[place + 1] - use_begin_[place]);
  }
  std::optional<double> Evaluate(const std::vector<double>& values, bool with_jacobians);
  std::optional<double> EvaluateResidual(size_t r, const std::vector<double>& values, bool with_jacobians,
                                         std::vector<double>* scratch);

  const SchurProblem& problem_;
  int num_threads_;
  std::vector<int> points_, others_;
  std::vector<int> index_;               // per block
  std::vector<size_t> value_begin_;      // per block, and the end
  std::vector<Use> uses_;                // of points, then of others
  std::vector<size_t> use_begin_;        // per point, then per other, and the end
  std::vector<size_t> jacobian_begin_;   // per residual
  std::unique_ptr<double[]> jacobians_;  // not cleared: threads write where they evaluate
  std::vector<size_t> plus_begin_;       // per other
  std::vector<double> plus_jacobians_;   // of manifolds' Plus
};

}  // namespace cairn
