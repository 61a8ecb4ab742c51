#include "stages/reconstruct/globally/position_images.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <ceres/ceres.h>

#include "core/base/quantiles.h"
#include "core/base/random.h"
#include "core/structure/bundle_blocks.h"

namespace cairn::reconstruct {
namespace {

constexpr double kHalfSideOfStart = 100, kLeastFactor = 1e-5;
constexpr double kShortestStep = 0.1;  // of a typical one
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

// How far two centres are apart, against a typical step of a drive: weight * log(length / step), which
// shrinking steps resist as growing ones do.  A camera that stands has kShortestStep.
class StepCost : public ceres::SizedCostFunction<1, 3, 3> {
 public:
  StepCost(double step, double weight) : step_(step), weight_(weight) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> from(parameters[0]), to(parameters[1]);
    const Eigen::Vector3d way = to - from;
    const double squared = way.squaredNorm() + kShortestStep * kShortestStep * step_ * step_;
    residuals[0] = weight_ * 0.5 * std::log(squared / (step_ * step_));
    if (jacobians == nullptr) return true;
    const Eigen::Vector3d slope = way * (weight_ / squared);
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

// Centres, points, factors, in one piece: Ceres orders blocks by their addresses, and another order is
// another rounding.
class Places {
 public:
  Places(size_t num_images, size_t num_points, size_t num_sights)
      : num_images_(num_images),
        num_points_(num_points),
        values_(3 * (num_images + num_points) + num_sights, 1) {}

  double* Center(size_t image) { return &values_[3 * image]; }
  double* Point(size_t point) { return &values_[3 * (num_images_ + point)]; }
  double* Factor(size_t sight) { return &values_[3 * (num_images_ + num_points_) + sight]; }

  Positions Found() {
    Positions positions;
    for (size_t i = 0; i < num_images_; ++i) positions.centers.emplace_back(Center(i));
    for (size_t k = 0; k < num_points_; ++k) positions.points.emplace_back(Point(k));
    return positions;
  }

  size_t num_images() const { return num_images_; }
  size_t num_points() const { return num_points_; }

 private:
  size_t num_images_, num_points_;
  std::vector<double> values_;
};

void BeginAnywhere(uint64_t seed, Places* places) {
  Random random(seed);
  const auto draw = [&](double* place) {
    for (int k = 0; k < 3; ++k) place[k] = random.Uniform(-kHalfSideOfStart, kHalfSideOfStart);
  };
  for (size_t i = 0; i < places->num_images(); ++i) draw(places->Center(i));
  for (size_t k = 0; k < places->num_points(); ++k) draw(places->Point(k));
}

void BeginAlongWays(const std::vector<Step>& steps, const std::vector<Sight>& sights, double typical_way,
                    Places* places) {
  for (size_t i = 0; i < places->num_images(); ++i) std::fill_n(places->Center(i), 3, 0.0);
  for (size_t k = 0; k < places->num_points(); ++k) std::fill_n(places->Point(k), 3, 0.0);
  std::vector<bool> is_known(places->num_images(), false);
  for (const Step& step : steps) {
    if (is_known[step.to] && !step.way) continue;
    is_known[step.to] = step.way.has_value();
    for (int k = 0; k < 3; ++k)
      places->Center(step.to)[k] = places->Center(step.from)[k] + (step.way ? (*step.way)[k] : 0);
  }
  const double depth = kStepsToPoints * typical_way;
  std::vector<int> num_sights(places->num_points(), 0);
  for (const Sight& sight : sights) ++num_sights[sight.point];
  for (size_t s = 0; s < sights.size(); ++s) {
    const Sight& sight = sights[s];
    for (int k = 0; k < 3; ++k)
      places->Point(sight.point)[k] +=
          (places->Center(sight.image)[k] + depth * sight.direction[k]) / num_sights[sight.point];
    *places->Factor(s) = 1 / depth;
  }
}

void Solve(const std::vector<Sight>& sights, const std::vector<Step>& steps, double typical_way,
           const PositionImagesOptions& options, Places* places) {
  ceres::Problem::Options problem_options;
  problem_options.disable_all_safety_checks = true;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::HuberLoss loss(options.loss_scale);
  ceres::HuberLoss step_loss(options.step_weight);
  ceres::Problem problem(problem_options);
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (size_t s = 0; s < sights.size(); ++s) {
    problem.AddResidualBlock(new SightCost(sights[s].direction), &loss, places->Factor(s),
                             places->Point(sights[s].point), places->Center(sights[s].image));
    problem.SetParameterLowerBound(places->Factor(s), 0, kLeastFactor);
    ordering->AddElementToGroup(places->Factor(s), 0);
  }
  for (const Step& step : steps) {
    double *from = places->Center(step.from), *to = places->Center(step.to);
    if (step.way && typical_way > 0) {
      problem.AddResidualBlock(new WayCost(*step.way, options.way_weight / typical_way), &loss, from, to);
    } else if (problem.HasParameterBlock(from) && problem.HasParameterBlock(to)) {
      problem.AddResidualBlock(new StepCost(typical_way > 0 ? typical_way : 1, options.step_weight),
                               &step_loss, from, to);
    }
  }
  for (size_t k = 0; k < places->num_points(); ++k) {
    if (problem.HasParameterBlock(places->Point(k))) ordering->AddElementToGroup(places->Point(k), 1);
  }
  for (size_t i = 0; i < places->num_images(); ++i) {
    if (problem.HasParameterBlock(places->Center(i))) ordering->AddElementToGroup(places->Center(i), 2);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = 1e-5;
  SolveOnOneThread(solver, &problem);
}

}  // namespace

Positions PositionImages(int num_images, int num_points, const std::vector<Sight>& sights,
                         const std::vector<Step>& steps, const PositionImagesOptions& options) {
  Places places(num_images, num_points, sights.size());
  const double typical_way = TypicalWay(steps);
  if (typical_way > 0) {
    BeginAlongWays(steps, sights, typical_way, &places);
  } else {
    BeginAnywhere(options.seed, &places);
  }
  Solve(sights, steps, typical_way, options, &places);
  return places.Found();
}

Positions RepositionImages(const Positions& start, const std::vector<Sight>& sights,
                           const std::vector<Step>& steps, const PositionImagesOptions& options) {
  Places places(start.centers.size(), start.points.size(), sights.size());
  for (size_t i = 0; i < start.centers.size(); ++i)
    Eigen::Map<Eigen::Vector3d>(places.Center(i)) = start.centers[i];
  for (size_t k = 0; k < start.points.size(); ++k)
    Eigen::Map<Eigen::Vector3d>(places.Point(k)) = start.points[k];
  for (size_t s = 0; s < sights.size(); ++s) {
    const Eigen::Vector3d way = start.points[sights[s].point] - start.centers[sights[s].image];
    *places.Factor(s) =
        std::max(kLeastFactor, way.dot(sights[s].direction) / std::max(way.squaredNorm(), 1e-12));
  }
  Solve(sights, steps, TypicalWay(steps), options, &places);
  return places.Found();
}

}  // namespace cairn::reconstruct
