#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <vector>

#include <ceres/ceres.h>

namespace cairn {

// A sum of squares over points and other blocks of parameters, each residual of which depends on one point at
// most: what a bundle adjustment minimises,
//   1/2 sum_i rho_i(|f_i(blocks)|^2).
// Costs, losses and manifolds are Ceres', and the caller's: they are referred to.  Losses' second derivatives
// are never positive, as those of all losses of Ceres but Tolerant are.
class SchurProblem {
 public:
  struct Block {
    double* values = nullptr;
    int size = 0, tangent_size = 0;
    const ceres::Manifold* manifold = nullptr;  // null: Euclidean
    bool is_point = false, is_constant = false;
  };
  struct Residual {
    const ceres::CostFunction* cost = nullptr;
    const ceres::LossFunction* loss = nullptr;  // null: squares
    size_t first_block = 0;
  };
  struct Bound {
    int block = 0, parameter = 0;
    double lower = 0, upper = 0;
  };

  // Blocks are numbered from 0 in the order in which they are added.  `values` are refined in place.
  int AddPoint(double* values);
  int AddBlock(double* values, int size, const ceres::Manifold* manifold = nullptr);
  // REQUIRES: not a point
  void SetConstant(int block) { blocks_[block].is_constant = true; }
  // REQUIRES: a Euclidean block
  void SetBounds(int block, int parameter, double lower, double upper) {
    bounds_.push_back({block, parameter, lower, upper});
  }
  // REQUIRES: different blocks, as many as the cost has, of their sizes
  void AddResidual(const ceres::CostFunction* cost, const ceres::LossFunction* loss,
                   std::initializer_list<int> blocks) {
    residuals_.push_back({cost, loss, residual_blocks_.size()});
    residual_blocks_.insert(residual_blocks_.end(), blocks);
  }

  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<Residual>& residuals() const { return residuals_; }
  const std::vector<Bound>& bounds() const { return bounds_; }
  std::span<const int> BlocksOf(const Residual& residual) const {
    return std::span<const int>(residual_blocks_)
        .subspan(residual.first_block, residual.cost->parameter_block_sizes().size());
  }

 private:
  std::vector<Block> blocks_;
  std::vector<Residual> residuals_;
  std::vector<int> residual_blocks_;
  std::vector<Bound> bounds_;
};

inline int SchurProblem::AddPoint(double* values) {
  blocks_.push_back({values, 3, 3, nullptr, true, false});
  return static_cast<int>(blocks_.size()) - 1;
}

inline int SchurProblem::AddBlock(double* values, int size, const ceres::Manifold* manifold) {
  blocks_.push_back(
      {values, size, manifold != nullptr ? manifold->TangentSize() : size, manifold, false, false});
  return static_cast<int>(blocks_.size()) - 1;
}

}  // namespace cairn
