#include "stages/reconstruct/globally/position_images.h"

#include <algorithm>
#include <memory>

#include <ceres/ceres.h>

#include "core/base/random.h"
#include "core/structure/bundle_blocks.h"

namespace cairn::reconstruct {
namespace {

constexpr double kHalfSideOfStart = 100, kLeastFactor = 1e-5;

// v - d (X - c)
class SightCost : public ceres::SizedCostFunction<3, 1, 3, 3> {
 public:
  explicit SightCost(const Eigen::Vector3d& direction) : direction_(direction) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double factor = parameters[0][0];
    const Eigen::Map<const Eigen::Vector3d> point(parameters[1]), center(parameters[2]);
    const Eigen::Vector3d way = point - center;
    Eigen::Map<Eigen::Vector3d> residual(residuals);
    residual = direction_ - factor * way;
    if (jacobians == nullptr) return true;
    const auto write = [&](int block, const auto& derivative) {
      if (jacobians[block] == nullptr) return;
      std::copy_n(derivative.data(), derivative.size(), jacobians[block]);
    };
    write(0, (-way).eval());
    write(1, (-factor * Eigen::Matrix3d::Identity()).eval());
    write(2, (factor * Eigen::Matrix3d::Identity()).eval());
    return true;
  }

 private:
  Eigen::Vector3d direction_;
};

// How far two centres are apart, against a typical step of a drive: weight * (length / step - 1).
class StepCost : public ceres::SizedCostFunction<1, 3, 3> {
 public:
  StepCost(double step, double weight) : step_(step), weight_(weight) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> from(parameters[0]), to(parameters[1]);
    const Eigen::Vector3d way = to - from;
    const double length = way.norm();
    residuals[0] = weight_ * (length / step_ - 1);
    if (jacobians == nullptr) return true;
    const Eigen::Vector3d slope =
        length > 0 ? Eigen::Vector3d(way * (weight_ / (length * step_))) : Eigen::Vector3d::Zero();
    for (int side = 0; side < 2; ++side) {
      if (jacobians[side] == nullptr) continue;
      for (int k = 0; k < 3; ++k) jacobians[side][k] = side == 0 ? -slope[k] : slope[k];
    }
    return true;
  }

 private:
  double step_, weight_;
};

}  // namespace

Positions PositionImages(int num_images, int num_points, const std::vector<Sight>& sights, bool is_drive,
                         const PositionImagesOptions& options) {
  // Centres, points, factors, in one piece: Ceres orders blocks by their addresses, and another order is
  // another rounding.
  const size_t num_places = static_cast<size_t>(num_images) + num_points;
  std::vector<double> values(3 * num_places + sights.size(), 1);
  Random random(options.seed);
  for (size_t i = 0; i < 3 * num_places; ++i) values[i] = random.Uniform(-kHalfSideOfStart, kHalfSideOfStart);
  const auto center_of = [&](int image) { return &values[3 * static_cast<size_t>(image)]; };
  const auto point_of = [&](int point) { return &values[3 * (static_cast<size_t>(num_images) + point)]; };
  const auto factor_of = [&](size_t sight) { return &values[3 * num_places + sight]; };

  ceres::Problem::Options problem_options;
  problem_options.disable_all_safety_checks = true;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::HuberLoss loss(options.loss_scale);
  ceres::HuberLoss step_loss(options.step_weight);
  ceres::Problem problem(problem_options);
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (size_t s = 0; s < sights.size(); ++s) {
    problem.AddResidualBlock(new SightCost(sights[s].direction), &loss, factor_of(s),
                             point_of(sights[s].point), center_of(sights[s].image));
    problem.SetParameterLowerBound(factor_of(s), 0, kLeastFactor);
    ordering->AddElementToGroup(factor_of(s), 0);
  }
  for (int i = 1; i < num_images && is_drive; ++i) {
    if (!problem.HasParameterBlock(center_of(i - 1)) || !problem.HasParameterBlock(center_of(i))) continue;
    problem.AddResidualBlock(new StepCost(1, options.step_weight), &step_loss, center_of(i - 1),
                             center_of(i));
  }
  for (int k = 0; k < num_points; ++k) {
    if (problem.HasParameterBlock(point_of(k))) ordering->AddElementToGroup(point_of(k), 1);
  }
  for (int i = 0; i < num_images; ++i) {
    if (problem.HasParameterBlock(center_of(i))) ordering->AddElementToGroup(center_of(i), 2);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = 1e-5;
  SolveOnOneThread(solver, &problem);
  Positions positions;
  for (int i = 0; i < num_images; ++i) positions.centers.emplace_back(center_of(i));
  for (int k = 0; k < num_points; ++k) positions.points.emplace_back(point_of(k));
  return positions;
}

}  // namespace cairn::reconstruct
