#include "core/structure/schur_system.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "core/base/random.h"

namespace cairn {
namespace {

// A sum of matrices times blocks, and a constant.
class LinearCost : public ceres::CostFunction {
 public:
  LinearCost(int num_rows, const std::vector<int>& sizes, Random* random) {
    set_num_residuals(num_rows);
    const auto draw = [&](int num_cols) {
      Eigen::MatrixXd matrix(num_rows, num_cols);
      for (double& value : matrix.reshaped()) value = random->Uniform(-1, 1);
      return matrix;
    };
    for (const int size : sizes) {
      mutable_parameter_block_sizes()->push_back(size);
      by_block.push_back(draw(size));
    }
    constant = draw(1);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Map<Eigen::VectorXd> out(residuals, num_residuals());
    out = constant;
    for (size_t b = 0; b < by_block.size(); ++b) {
      const Eigen::Index size = by_block[b].cols();
      out += by_block[b] * Eigen::Map<const Eigen::VectorXd>(parameters[b], size);
      if (jacobians == nullptr || jacobians[b] == nullptr) continue;
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[b], num_residuals(), size) = by_block[b];
    }
    return true;
  }

  std::vector<Eigen::MatrixXd> by_block;
  Eigen::VectorXd constant;
};

// A problem of blocks of many sizes, some of them constant, and the same as dense matrices.
struct LinearScene {
  std::deque<std::vector<double>> values;
  std::deque<LinearCost> costs;
  std::unique_ptr<ceres::LossFunction> loss;  // of every third residual
  std::vector<std::vector<int>> blocks_of;    // per residual
  SchurProblem problem;

  int AddBlock(int size, bool is_point, Random* random) {
    values.emplace_back(size);
    for (double& value : values.back()) value = random->Uniform(-1, 1);
    return is_point ? problem.AddPoint(values.back().data()) : problem.AddBlock(values.back().data(), size);
  }
  void AddResidual(int num_rows, const std::vector<int>& blocks, Random* random) {
    std::vector<int> sizes;
    for (const int b : blocks) sizes.push_back(problem.blocks()[b].size);
    const bool is_robust = loss != nullptr && blocks_of.size() % 3 == 0;
    const ceres::CostFunction* cost = &costs.emplace_back(num_rows, sizes, random);
    const ceres::LossFunction* its_loss = is_robust ? loss.get() : nullptr;
    blocks_of.push_back(blocks);
    if (blocks.size() == 1) problem.AddResidual(cost, its_loss, {blocks[0]});
    if (blocks.size() == 2) problem.AddResidual(cost, its_loss, {blocks[0], blocks[1]});
    if (blocks.size() == 3) problem.AddResidual(cost, its_loss, {blocks[0], blocks[1], blocks[2]});
  }
};

std::unique_ptr<LinearScene> MakeLinearScene(int num_points, bool is_robust) {
  auto scene = std::make_unique<LinearScene>();
  Random random(num_points);
  if (is_robust) scene->loss = std::make_unique<ceres::CauchyLoss>(0.7);
  std::vector<int> others, points;
  for (int i = 0; i < num_points; ++i) {
    constexpr int kSizes[] = {6, 2, 6, 3, 1, 6, 7, 6};
    if (i < 8) others.push_back(scene->AddBlock(kSizes[i], false, &random));
    points.push_back(scene->AddBlock(3, true, &random));
  }
  scene->problem.SetConstant(others[3]);
  scene->problem.SetConstant(points[4]);
  for (const int b : others) scene->AddResidual(7, {b}, &random);
  scene->AddResidual(3, {others[1], others[6]}, &random);  // that see no point together
  scene->AddResidual(2, {others[7], others[3]}, &random);
  for (int p = 0; p < num_points; ++p) {
    for (int k = 0; k < 4; ++k) {
      const int first = others[random.UniformInt(0, 6)];
      if (k == 0) scene->AddResidual(2, {first, points[p]}, &random);
      if (k == 1) scene->AddResidual(3, {points[p], others[7], first}, &random);
      if (k == 2) scene->AddResidual(1, {first, points[p], others[7]}, &random);
      if (k == 3) scene->AddResidual(2, {points[p]}, &random);
    }
  }
  return scene;
}

// What SchurSystem is about, from the whole Jacobian: rows of all residuals, weighted.
struct DenseSystem {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
  std::vector<Eigen::Index> first_row;  // of each residual
  double cost = 0;
};

DenseSystem MakeDense(const LinearScene& scene, const SchurSystem& system) {
  DenseSystem dense;
  Eigen::Index num_rows = 0;
  for (const LinearCost& cost : scene.costs) {
    dense.first_row.push_back(num_rows);
    num_rows += cost.num_residuals();
  }
  const auto num_points = static_cast<Eigen::Index>(system.terms().points().size());
  dense.jacobian.setZero(num_rows, system.num_rows() + 3 * num_points);
  dense.residual.resize(num_rows);
  for (size_t r = 0; r < scene.costs.size(); ++r) {
    const LinearCost& cost = scene.costs[r];
    Eigen::VectorXd residual = cost.constant;
    for (size_t a = 0; a < cost.by_block.size(); ++a) {
      const std::vector<double>& values = scene.values[scene.blocks_of[r][a]];
      residual += cost.by_block[a] * Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
    }
    double rho[3] = {residual.squaredNorm(), 1, 0};
    if (scene.loss != nullptr && r % 3 == 0) scene.loss->Evaluate(residual.squaredNorm(), rho);
    dense.cost += 0.5 * rho[0];
    dense.residual.segment(dense.first_row[r], residual.size()) = std::sqrt(rho[1]) * residual;
    for (size_t a = 0; a < cost.by_block.size(); ++a) {
      const int b = scene.blocks_of[r][a];
      const int index = system.terms().index_of(b);
      if (index < 0) continue;
      const Eigen::Index col =
          scene.problem.blocks()[b].is_point ? system.num_rows() + 3 * index : system.first_row(b);
      dense.jacobian.block(dense.first_row[r], col, residual.size(), cost.by_block[a].cols()) =
          std::sqrt(rho[1]) * cost.by_block[a];
    }
  }
  return dense;
}

double RelativeError(const Eigen::VectorXd& found, const Eigen::VectorXd& expected) {
  return (found - expected).norm() / expected.norm();
}

TEST(SchurSystem, IsTheDenseSystemWithItsPointsEliminated) {
  for (const bool is_robust : {false, true}) {
    const auto scene = MakeLinearScene(20, is_robust);
    Eigen::VectorXd first_step;
    for (const int num_threads : {1, 3}) {
      SchurSystem system(scene->problem, num_threads);
      EXPECT_EQ(system.num_rows(), 6 + 2 + 6 + 1 + 6 + 7 + 6);
      EXPECT_EQ(system.terms().points().size(), 19u);
      const std::vector<double> values = system.terms().Values();
      const DenseSystem dense = MakeDense(*scene, system);
      EXPECT_NEAR(*system.Cost(values), dense.cost, 1e-12 * dense.cost);
      EXPECT_NEAR(*system.Linearize(values), dense.cost, 1e-12 * dense.cost);
      EXPECT_LT(RelativeError(system.gradient(), dense.jacobian.transpose() * dense.residual), 1e-12);
      Eigen::MatrixXd square = dense.jacobian.transpose() * dense.jacobian;
      EXPECT_LT(RelativeError(system.diagonal(), square.diagonal()), 1e-12);
      // Each row is damped differently.
      const Eigen::VectorXd damping = Eigen::VectorXd::LinSpaced(square.rows(), 0.1, 0.9);
      square.diagonal() += damping;
      Eigen::VectorXd step;
      ASSERT_TRUE(system.Solve(damping, &step));
      EXPECT_LT(RelativeError(step, square.llt().solve(-system.gradient())), 1e-10);
      // The reduced matrix.
      const Eigen::Index n = system.num_rows(), m = square.rows() - n;
      const Eigen::MatrixXd reduced =
          square.topLeftCorner(n, n) -
          square.topRightCorner(n, m) *
              square.bottomRightCorner(m, m).llt().solve(square.bottomLeftCorner(m, n));
      for (size_t r = 0; r < scene->costs.size(); r += 5) {
        const Eigen::Index num = scene->costs[r].num_residuals();
        const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(num, -1, 2);
        const Eigen::VectorXd before = Eigen::VectorXd::LinSpaced(n, 1, 3);
        Eigen::VectorXd side = before;
        system.AddTransposed(static_cast<int>(r), weights, &side);
        const Eigen::VectorXd expected =
            before + dense.jacobian.block(dense.first_row[r], 0, num, n).transpose() * weights;
        EXPECT_LT(RelativeError(side, expected), 1e-12) << r;
        system.SolveReduced(&side);
        EXPECT_LT(RelativeError(side, reduced.llt().solve(expected)), 1e-10) << r;
      }
      if (first_step.size() == 0) first_step = step;
      EXPECT_EQ(step, first_step);
    }
  }
}

TEST(SchurSystem, ManyPointsAndResidualsAreSummedInParts) {
  const auto scene = MakeLinearScene(560, true);
  SchurSystem system(scene->problem, 3);
  const std::vector<double> values = system.terms().Values();
  const DenseSystem dense = MakeDense(*scene, system);
  EXPECT_NEAR(*system.Linearize(values), dense.cost, 1e-12 * dense.cost);
  EXPECT_LT(RelativeError(system.gradient(), dense.jacobian.transpose() * dense.residual), 1e-12);
  EXPECT_LT(RelativeError(system.diagonal(), dense.jacobian.colwise().squaredNorm().transpose()), 1e-12);
  const Eigen::VectorXd damping = Eigen::VectorXd::Constant(system.gradient().size(), 0.3);
  Eigen::VectorXd step;
  ASSERT_TRUE(system.Solve(damping, &step));
  const Eigen::VectorXd product =
      dense.jacobian.transpose() * (dense.jacobian * step) + damping.cwiseProduct(step);
  EXPECT_LT(RelativeError(product, -system.gradient()), 1e-10);
}

TEST(SchurSystem, AStepGoesToEachBlockAndEndsAtBounds) {
  const auto scene = MakeLinearScene(12, false);
  const int bounded = 2, constant = 6;  // the second of the others, of two values, and the fourth
  ASSERT_EQ(scene->problem.blocks()[bounded].size, 2);
  ASSERT_TRUE(scene->problem.blocks()[constant].is_constant);
  scene->problem.SetBounds(constant, 0, 100, 200);  // is not looked at
  scene->problem.SetBounds(bounded, 1, -1.5, 1.5);
  SchurSystem system(scene->problem, 2);
  const std::vector<double> values = system.terms().Values();
  for (const double sign : {1.0, -1.0}) {
    const Eigen::VectorXd step = sign * Eigen::VectorXd::LinSpaced(system.gradient().size(), 3, 4);
    const std::vector<double> sum = system.Plus(values, step);
    for (size_t b = 0; b < scene->values.size(); ++b) {
      const SchurProblem::Block& block = scene->problem.blocks()[b];
      const int index = system.terms().index_of(static_cast<int>(b));
      for (int k = 0; k < block.size; ++k) {
        const size_t at = system.terms().value_begin(static_cast<int>(b)) + k;
        double expected = scene->values[b][k];
        EXPECT_EQ(values[at], expected);
        if (index >= 0) {
          expected +=
              step[(block.is_point ? system.num_rows() + 3 * index : system.first_row(static_cast<int>(b))) +
                   k];
        }
        if (static_cast<int>(b) == bounded && k == 1) expected = 1.5 * sign;
        EXPECT_EQ(sum[at], expected) << b << " " << k;
      }
    }
    system.terms().Store(sum);
    for (size_t b = 0; b < scene->values.size(); ++b) {
      const bool is_constant = scene->problem.blocks()[b].is_constant;
      EXPECT_EQ(scene->values[b][0],
                (is_constant ? values : sum)[system.terms().value_begin(static_cast<int>(b))]);
    }
    system.terms().Store(values);
  }
}

}  // namespace
}  // namespace cairn
