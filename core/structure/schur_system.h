#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/structure/block_cholesky.h"
#include "core/structure/schur_terms.h"

namespace cairn {

// The normal equations of a SchurProblem, H = J^T J, with its points eliminated [Triggs00 §6.1; Agarwal10
// §3]:
//   (H_bb - H_bp H_pp^-1 H_pb) step_b = -g_b + H_bp H_pp^-1 g_p
// of which H_pp has blocks of 3 x 3, and BlockCholesky solves what is left.
//
// Everything is evaluated into its own place and summed by one thread in one order: results do not depend on
// the number of threads.  Vectors stand for free parameters in tangent space: blocks in the order of
// elimination, then points.
//   Triggs00: Bundle adjustment, a modern synthesis.  Agarwal10: Bundle adjustment in the large.
class SchurSystem {
 public:
  SchurSystem(const SchurProblem& problem, int num_threads);

  const SchurTerms& terms() const { return terms_; }
  std::optional<double> Cost(const std::vector<double>& values) { return terms_.Cost(values); }
  // SchurTerms::Values() + step, within their bounds.
  std::vector<double> Plus(const std::vector<double>& values, const Eigen::VectorXd& step) const;

  // SchurTerms' sum, and nothing where that is nothing; what follows is about these values.
  std::optional<double> Linearize(const std::vector<double>& values);
  const Eigen::VectorXd& gradient() const { return gradient_; }
  // Of H.
  const Eigen::VectorXd& diagonal() const { return diagonal_; }
  // The step for which (H + diag(damping)) step = -gradient.  False: the matrix is not positive definite.
  bool Solve(const Eigen::VectorXd& damping, Eigen::VectorXd* step);

  // Of free blocks other than points: the number of their rows, and where those of one begin.
  Eigen::Index num_rows() const { return cholesky_->num_rows(); }
  Eigen::Index first_row(int block) const {
    return cholesky_->first_row(cholesky_->position_of(terms_.index_of(block)));
  }
  // side += J^T weights over the rows of a residual, by these blocks.
  void AddTransposed(int residual, const Eigen::VectorXd& weights, Eigen::VectorXd* side) const;
  // Of the reduced matrix times x = side, in place.  REQUIRES: Solve() returned true
  void SolveReduced(Eigen::VectorXd* side) const { cholesky_->Solve(side); }

 private:
  BlockCholesky MakeCholesky() const;
  void OrderSlots();
  void SumGradient();
  template <typename Body>
  void ForEachOther(int residual, const Body& body) const;
  bool EliminatePoint(int point, const Eigen::VectorXd& damping);
  void SetColumn(int position, const Eigen::VectorXd& damping, Eigen::VectorXd* right_side);
  void SubtractSlots(size_t first, size_t end, const std::vector<int>& begin,
                     std::vector<double>* column) const;

  SchurTerms terms_;
  int num_threads_;
  // A slot: a block that sees a point, by points and positions.
  std::vector<size_t> slot_begin_;  // per point, and the end
  std::vector<int> slot_position_;
  std::vector<size_t> slot_values_;  // where its rows begin in projected_
  // The slots of each position.
  struct ColumnSlot {
    size_t slot = 0;
    int point = 0;
  };
  std::vector<ColumnSlot> column_slots_;
  std::vector<size_t> column_begin_;  // per position, and the end
  // H_pp = L L^T: per slot H_bp L^-T, not cleared as threads do it; per point L and L^-1 g_p.
  std::unique_ptr<double[]> projected_;
  std::vector<Eigen::Matrix3d> point_factor_;
  std::vector<Eigen::Vector3d> point_side_;
  Eigen::VectorXd gradient_, diagonal_;
  std::optional<BlockCholesky> cholesky_;
};

}  // namespace cairn
