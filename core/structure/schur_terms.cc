#include "core/structure/schur_terms.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "core/base/parallel.h"

namespace cairn {
namespace {

constexpr int64_t kResidualsAtOnce = 512;  // by one thread
constexpr size_t kMaxArguments = 10;       // of a cost, as of Ceres' own

}  // namespace

SchurTerms::SchurTerms(const SchurProblem& problem, int num_threads)
    : problem_(problem), num_threads_(num_threads) {
  value_begin_ = {0};
  size_t num_plus = 0;
  for (const SchurProblem::Block& block : problem.blocks()) {
    const auto b = static_cast<int>(value_begin_.size()) - 1;
    value_begin_.push_back(value_begin_.back() + block.size);
    std::vector<int>& blocks = block.is_point ? points_ : others_;
    index_.push_back(block.is_constant ? -1 : static_cast<int>(blocks.size()));
    if (block.is_constant) continue;
    blocks.push_back(b);
    if (block.is_point) continue;
    plus_begin_.push_back(num_plus);
    if (block.manifold != nullptr) num_plus += static_cast<size_t>(block.size) * block.tangent_size;
  }
  plus_jacobians_.resize(num_plus);
  FindUses();
}

void SchurTerms::FindUses() {
  const auto place = [&](int b) {
    return index_[b] + (problem_.blocks()[b].is_point ? 0 : std::ssize(points_));
  };
  use_begin_.assign(points_.size() + others_.size() + 1, 0);
  size_t num_values = 0;
  for (const SchurProblem::Residual& residual : problem_.residuals()) {
    jacobian_begin_.push_back(num_values);
    size_t num_cols = 1;
    for (const int b : problem_.BlocksOf(residual)) {
      if (index_[b] < 0) continue;
      ++use_begin_[place(b) + 1];
      num_cols += problem_.blocks()[b].tangent_size;
    }
    num_values += residual.cost->num_residuals() * num_cols;
  }
  jacobians_ = std::make_unique_for_overwrite<double[]>(num_values);
  std::partial_sum(use_begin_.begin(), use_begin_.end(), use_begin_.begin());
  uses_.resize(use_begin_.back());
  std::vector<size_t> next(use_begin_.begin(), use_begin_.end() - 1);
  for (size_t r = 0; r < problem_.residuals().size(); ++r) {
    const std::span<const int> used = problem_.BlocksOf(problem_.residuals()[r]);
    for (size_t a = 0; a < used.size(); ++a) {
      if (index_[used[a]] >= 0) uses_[next[place(used[a])]++] = {static_cast<int>(r), static_cast<int>(a)};
    }
  }
}

std::vector<double> SchurTerms::Values() const {
  std::vector<double> values;
  for (const SchurProblem::Block& block : problem_.blocks())
    values.insert(values.end(), block.values, block.values + block.size);
  return values;
}

void SchurTerms::Store(const std::vector<double>& values) const {
  for (size_t b = 0; b < problem_.blocks().size(); ++b) {
    const SchurProblem::Block& block = problem_.blocks()[b];
    if (!block.is_constant) std::copy_n(&values[value_begin_[b]], block.size, block.values);
  }
}

std::optional<double> SchurTerms::Linearize(const std::vector<double>& values) {
  for (size_t i = 0; i < others_.size(); ++i) {
    const SchurProblem::Block& block = problem_.blocks()[others_[i]];
    if (block.manifold != nullptr)
      block.manifold->PlusJacobian(&values[value_begin_[others_[i]]], &plus_jacobians_[plus_begin_[i]]);
  }
  return Evaluate(values, true);
}

std::optional<double> SchurTerms::Evaluate(const std::vector<double>& values, bool with_jacobians) {
  const auto num_residuals = static_cast<int64_t>(problem_.residuals().size());
  const int64_t num_chunks = (num_residuals + kResidualsAtOnce - 1) / kResidualsAtOnce;
  std::vector<double> sums(num_chunks, 0);
  std::atomic<bool> is_possible = true;
  ParallelForRuns(num_residuals, kResidualsAtOnce, num_threads_, [&](int64_t begin, int64_t end) {
    std::vector<double> scratch;
    double& sum = sums[begin / kResidualsAtOnce];
    for (int64_t r = begin; r < end; ++r) {
      const auto cost = EvaluateResidual(r, values, with_jacobians, &scratch);
      if (!cost) is_possible = false;
      sum += cost.value_or(0);
    }
  });
  const double cost = std::accumulate(sums.begin(), sums.end(), 0.0);
  if (!is_possible || !std::isfinite(cost)) return std::nullopt;
  return cost;
}

std::optional<double> SchurTerms::EvaluateResidual(size_t r, const std::vector<double>& values,
                                                   bool with_jacobians, std::vector<double>* scratch) {
  const SchurProblem::Residual& residual = problem_.residuals()[r];
  const std::span<const int> used = problem_.BlocksOf(residual);
  const int num_rows = residual.cost->num_residuals();
  // Residuals, then Jacobians by a block's values.
  size_t num_needed = num_rows;
  for (const int b : used) num_needed += static_cast<size_t>(num_rows) * problem_.blocks()[b].size;
  if (scratch->size() < num_needed) scratch->resize(num_needed);
  const double* parameters[kMaxArguments];
  double* by_values[kMaxArguments];
  double* next = scratch->data() + num_rows;
  for (size_t a = 0; a < used.size(); ++a) {
    parameters[a] = &values[value_begin_[used[a]]];
    by_values[a] = index_[used[a]] < 0 ? nullptr : next;
    next += static_cast<size_t>(num_rows) * problem_.blocks()[used[a]].size;
  }
  if (!residual.cost->Evaluate(parameters, scratch->data(), with_jacobians ? by_values : nullptr))
    return std::nullopt;
  const double square = Eigen::Map<const Eigen::VectorXd>(scratch->data(), num_rows).squaredNorm();
  double rho[3] = {square, 1, 0};
  if (residual.loss != nullptr) residual.loss->Evaluate(square, rho);
  if (!with_jacobians) return 0.5 * rho[0];
  const double weight = std::sqrt(rho[1]);
  double* out = &jacobians_[jacobian_begin_[r]];
  for (int k = 0; k < num_rows; ++k) *out++ = weight * (*scratch)[k];
  for (size_t a = 0; a < used.size(); ++a) {
    if (by_values[a] == nullptr) continue;
    const SchurProblem::Block& block = problem_.blocks()[used[a]];
    if (block.manifold == nullptr) {
      for (int k = 0; k < num_rows * block.size; ++k) *out++ = weight * by_values[a][k];
      continue;
    }
    const double* plus = &plus_jacobians_[plus_begin_[index_[used[a]]]];
    for (int k = 0; k < num_rows; ++k) {
      for (int c = 0; c < block.tangent_size; ++c) {
        double sum = 0;
        for (int v = 0; v < block.size; ++v)
          sum += by_values[a][k * block.size + v] * plus[v * block.tangent_size + c];
        *out++ = weight * sum;
      }
    }
  }
  return 0.5 * rho[0];
}

const double* SchurTerms::Jacobian(const Use& use) const {
  const SchurProblem::Residual& residual = problem_.residuals()[use.residual];
  const std::span<const int> used = problem_.BlocksOf(residual);
  size_t num_cols = 1;
  for (int a = 0; a < use.argument; ++a)
    num_cols += index_[used[a]] < 0 ? 0 : problem_.blocks()[used[a]].tangent_size;
  return &jacobians_[jacobian_begin_[use.residual] + residual.cost->num_residuals() * num_cols];
}

}  // namespace cairn
