#include "stages/group_classes/adjust/evidence.h"

#include <Eigen/Cholesky>

#include "core/base/random.h"

namespace cairn::group_classes {
namespace {

using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// L^-1 with L L' = the 3 x 3 matrices on the diagonal.
RowMatrix InverseRoots(const std::vector<Eigen::Matrix3d>& blocks) {
  std::vector<Eigen::Triplet<double>> triplets;
  for (size_t p = 0; p < blocks.size(); ++p) {
    const Eigen::LLT<Eigen::Matrix3d> factors(blocks[p]);
    if (factors.info() != Eigen::Success) continue;  // a point that nothing determines says nothing
    const Eigen::Matrix3d inverse = factors.matrixL().solve(Eigen::Matrix3d::Identity());
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c <= r; ++c)
        triplets.emplace_back(static_cast<int>(3 * p) + r, static_cast<int>(3 * p) + c, inverse(r, c));
    }
  }
  const auto size = static_cast<Eigen::Index>(3 * blocks.size());
  RowMatrix matrix(size, size);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  return matrix;
}

}  // namespace

ReducedSystem::ReducedSystem(const Eigen::Ref<const RowMatrix>& jacobian, int num_points) {
  const int num_point_columns = 3 * num_points;
  std::vector<Eigen::Matrix3d> blocks(num_points, Eigen::Matrix3d::Zero());
  std::vector<Eigen::Triplet<double>> of_points, of_others;
  for (int row = 0; row < jacobian.outerSize(); ++row) {
    Eigen::Vector3d on_point = Eigen::Vector3d::Zero();
    int point = -1;
    for (Eigen::Ref<const RowMatrix>::InnerIterator it(jacobian, row); it; ++it) {
      const int column = static_cast<int>(it.col());
      if (column < num_point_columns) {
        point = column / 3;
        on_point[column % 3] = it.value();
        of_points.emplace_back(row, column, it.value());
      } else {
        of_others.emplace_back(row, column - num_point_columns, it.value());
      }
    }
    if (point >= 0) blocks[point] += on_point * on_point.transpose();
  }
  RowMatrix points(jacobian.rows(), num_point_columns);
  points.setFromTriplets(of_points.begin(), of_points.end());
  others_.resize(jacobian.rows(), jacobian.cols() - num_point_columns);
  others_.setFromTriplets(of_others.begin(), of_others.end());
  const RowMatrix coupling = points.transpose() * others_;
  const RowMatrix rooted = InverseRoots(blocks) * coupling;
  Eigen::MatrixXd normal = RowMatrix(others_.transpose() * others_);
  for (int row = 0; row < rooted.outerSize(); ++row) {
    for (RowMatrix::InnerIterator a(rooted, row); a; ++a) {
      for (RowMatrix::InnerIterator b(rooted, row); b && b.col() <= a.col(); ++b)
        normal(a.col(), b.col()) -= a.value() * b.value();  // the lower half, which LLT reads
    }
  }
  for (Eigen::Index i = 0; i < normal.cols(); ++i) {
    double& diagonal = normal(i, i);
    diagonal = diagonal > 0 ? diagonal * (1 + 1e-9) : 1;
  }
  factors_.compute(normal);
}

double ReducedSystem::Trace(const std::vector<int>& rows) const {
  constexpr int kNumProbes = 16;
  Random random(1);
  Eigen::MatrixXd signs = Eigen::MatrixXd::Zero(others_.rows(), kNumProbes);
  for (int probe = 0; probe < kNumProbes; ++probe) {
    for (const int row : rows) signs(row, probe) = random.Uniform() < 0.5 ? -1 : 1;
  }
  const Eigen::MatrixXd y = others_.transpose() * signs;
  return y.cwiseProduct(factors_.solve(y)).sum() / kNumProbes;
}

Eigen::MatrixXd ReducedSystem::Covariance(int first, int size) const {
  Eigen::MatrixXd units = Eigen::MatrixXd::Zero(others_.cols(), size);
  units.middleRows(first, size).setIdentity();
  return factors_.solve(units).middleRows(first, size);
}

}  // namespace cairn::group_classes
