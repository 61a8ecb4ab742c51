#include "stages/reconstruct/globally/position_images.h"

#include <algorithm>
#include <memory>

#include <ceres/ceres.h>

#include "core/base/quantiles.h"
#include "core/base/random.h"
#include "core/structure/bundle_blocks.h"

namespace cairn::reconstruct {
namespace {

constexpr double kHalfSideOfStart = 100, kLeastFactor = 1e-5;
// Where ways are known points begin so many steps away.
constexpr double kStepsToPoints = 10;

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

// The way between two centres against a measured one: weight * (to - from - way).
class WayCost : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  WayCost(const Eigen::Vector3d& way, double weight) : way_(way), weight_(weight) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> from(parameters[0]), to(parameters[1]);
    Eigen::Map<Eigen::Vector3d> residual(residuals);
    residual = weight_ * (to - from - way_);
    if (jacobians == nullptr) return true;
    for (int side = 0; side < 2; ++side) {
      if (jacobians[side] == nullptr) continue;
      Eigen::Map<Eigen::Matrix3d> out(jacobians[side]);
      out = (side == 0 ? -weight_ : weight_) * Eigen::Matrix3d::Identity();
    }
    return true;
  }

 private:
  Eigen::Vector3d way_;
  double weight_;
};

// Median length of the known ways; none known: 0.
double TypicalWay(const std::vector<Step>& steps) {
  std::vector<double> lengths;
  for (const Step& step : steps) {
    if (step.way) lengths.push_back(step.way->norm());
  }
  return lengths.empty() ? 0 : Median(lengths);
}

}  // namespace

Positions PositionImages(int num_images, int num_points, const std::vector<Sight>& sights,
                         const std::vector<Step>& steps, const PositionImagesOptions& options) {
  // Centres, points, factors, in one piece: Ceres orders blocks by their addresses, and another order is
  // another rounding.
  const size_t num_places = static_cast<size_t>(num_images) + num_points;
  std::vector<double> values(3 * num_places + sights.size(), 1);
  Random random(options.seed);
  for (size_t i = 0; i < 3 * num_places; ++i) values[i] = random.Uniform(-kHalfSideOfStart, kHalfSideOfStart);
  const auto center_of = [&](int image) { return &values[3 * static_cast<size_t>(image)]; };
  const auto point_of = [&](int point) { return &values[3 * (static_cast<size_t>(num_images) + point)]; };
  const auto factor_of = [&](size_t sight) { return &values[3 * num_places + sight]; };

  const double typical_way = TypicalWay(steps);
  if (typical_way > 0) {
    std::fill_n(values.begin(), 3 * num_places, 0.0);
    std::vector<bool> is_known(num_images, false);
    for (const Step& step : steps) {
      if (is_known[step.to] && !step.way) continue;
      is_known[step.to] = step.way.has_value();
      for (int k = 0; k < 3; ++k)
        center_of(step.to)[k] = center_of(step.from)[k] + (step.way ? (*step.way)[k] : 0);
    }
    const double depth = kStepsToPoints * typical_way;
    std::vector<int> num_sights(num_points, 0);
    for (const Sight& sight : sights) ++num_sights[sight.point];
    for (size_t s = 0; s < sights.size(); ++s) {
      const Sight& sight = sights[s];
      for (int k = 0; k < 3; ++k)
        point_of(sight.point)[k] +=
            (center_of(sight.image)[k] + depth * sight.direction[k]) / num_sights[sight.point];
      *factor_of(s) = 1 / depth;
    }
  }

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
  for (const Step& step : steps) {
    double *from = center_of(step.from), *to = center_of(step.to);
    if (step.way && typical_way > 0) {
      problem.AddResidualBlock(new WayCost(*step.way, options.way_weight / typical_way), &loss, from, to);
    } else if (problem.HasParameterBlock(from) && problem.HasParameterBlock(to)) {
      problem.AddResidualBlock(new StepCost(typical_way > 0 ? typical_way : 1, options.step_weight),
                               &step_loss, from, to);
    }
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
