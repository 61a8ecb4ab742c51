#include "stages/reconstruct/globally/position_images.h"

#include <algorithm>
#include <memory>

#include <ceres/ceres.h>

#include "core/structure/bundle_blocks.h"

namespace cairn::reconstruct {
namespace {

// Points begin so many units away; factors, of one unit, are not smaller.
constexpr double kUnitsToPoints = 10, kLeastFactor = 1e-5;

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

}  // namespace

Positions PositionImages(const std::vector<Eigen::Vector3d>& start, int num_points,
                         const std::vector<Sight>& sights, const std::vector<Way>& ways, double unit,
                         const PositionImagesOptions& options) {
  // Centres, points, factors, in one piece: Ceres orders blocks by their addresses, and another order is
  // another rounding.
  const size_t num_images = start.size(), num_places = num_images + num_points;
  const double depth = kUnitsToPoints * unit;
  std::vector<double> values(3 * num_places, 0);
  values.resize(values.size() + sights.size(), 1 / depth);
  const auto center_of = [&](size_t image) { return &values[3 * image]; };
  const auto point_of = [&](size_t point) { return &values[3 * (num_images + point)]; };
  const auto factor_of = [&](size_t sight) { return &values[3 * num_places + sight]; };
  for (size_t i = 0; i < num_images; ++i) std::copy_n(start[i].data(), 3, center_of(i));
  std::vector<int> num_sights(num_points, 0);
  for (const Sight& sight : sights) ++num_sights[sight.point];
  for (const Sight& sight : sights) {
    for (int k = 0; k < 3; ++k)
      point_of(sight.point)[k] +=
          (start[sight.image][k] + depth * sight.direction[k]) / num_sights[sight.point];
  }

  ceres::Problem::Options problem_options;
  problem_options.disable_all_safety_checks = true;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::HuberLoss loss(options.loss_scale);
  ceres::Problem problem(problem_options);
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (size_t s = 0; s < sights.size(); ++s) {
    problem.AddResidualBlock(new SightCost(sights[s].direction), &loss, factor_of(s),
                             point_of(sights[s].point), center_of(sights[s].image));
    problem.SetParameterLowerBound(factor_of(s), 0, kLeastFactor / unit);
    ordering->AddElementToGroup(factor_of(s), 0);
  }
  for (const Way& way : ways)
    problem.AddResidualBlock(new WayCost(way.way, options.way_weight / unit), &loss, center_of(way.from),
                             center_of(way.to));
  for (int k = 0; k < num_points; ++k) {
    if (problem.HasParameterBlock(point_of(k))) ordering->AddElementToGroup(point_of(k), 1);
  }
  for (size_t i = 0; i < num_images; ++i) {
    if (problem.HasParameterBlock(center_of(i))) ordering->AddElementToGroup(center_of(i), 2);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = 1e-5;
  SolveOnOneThread(solver, &problem, options.progress);
  Positions positions;
  for (size_t i = 0; i < num_images; ++i) positions.centers.emplace_back(center_of(i));
  for (int k = 0; k < num_points; ++k) positions.points.emplace_back(point_of(k));
  return positions;
}

}  // namespace cairn::reconstruct
