#include "stages/group_classes/adjust/evidence.h"

#include <numeric>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/random.h"

namespace cairn::group_classes {
namespace {

// Of a column's squared length: what nothing determines is not determined.
constexpr double kDamping = 1e-9;

}  // namespace

ReducedSystem::ReducedSystem(const SchurProblem& problem, int num_threads)
    : num_threads_(num_threads), system_(problem, num_threads) {
  if (!system_.Linearize(system_.terms().Values())) return;
  const Eigen::ArrayXd diagonal = system_.diagonal().array();
  Eigen::VectorXd step;
  is_solved_ = system_.Solve((diagonal > 0).select(kDamping * diagonal, 1).matrix(), &step);
}

double ReducedSystem::Trace(std::span<const Row> rows) const {
  constexpr int kNumProbes = 16;
  Random random(1);
  std::vector<Eigen::VectorXd> sides(kNumProbes, Eigen::VectorXd::Zero(system_.num_rows()));
  for (Eigen::VectorXd& side : sides) {
    for (const Row& row : rows) {
      Eigen::VectorXd signs = Eigen::VectorXd::Zero(system_.terms().NumRows(row.residual));
      signs[row.row] = random.Uniform() < 0.5 ? -1 : 1;
      system_.AddTransposed(row.residual, signs, &side);
    }
  }
  std::vector<double> squares(kNumProbes);
  ParallelFor(kNumProbes, num_threads_, [&](int64_t probe) {
    Eigen::VectorXd solution = sides[probe];
    system_.SolveReduced(&solution);
    squares[probe] = sides[probe].dot(solution);
  });
  return std::accumulate(squares.begin(), squares.end(), 0.0) / kNumProbes;
}

Eigen::MatrixXd ReducedSystem::Covariance(int block) const {
  const int size = system_.terms().problem().blocks()[block].tangent_size;
  Eigen::MatrixXd covariance(size, size);
  for (int k = 0; k < size; ++k) {
    Eigen::VectorXd column = Eigen::VectorXd::Unit(system_.num_rows(), system_.first_row(block) + k);
    system_.SolveReduced(&column);
    covariance.col(k) = column.segment(system_.first_row(block), size);
  }
  return covariance;
}

}  // namespace cairn::group_classes
