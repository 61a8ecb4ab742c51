#include "core/structure/schur_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/base/parallel.h"
#include "core/structure/schur_system.h"

namespace cairn {
namespace {

// Ceres' defaults.
constexpr double kMinDiagonal = 1e-6;
constexpr double kMaxRadius = 1e16, kMinRadius = 1e-32;
constexpr double kMinQuality = 1e-3;  // of a step that is accepted
constexpr int kMaxNumInvalidSteps = 5;
constexpr double kSufficientDecrease = 1e-4;
constexpr double kMinContraction = 1e-3;
constexpr int kMaxNumContractions = 20;
constexpr int kMaxNumStepsOfPoint = 50;
constexpr double kFunctionTolerance = 1e-6, kParameterTolerance = 1e-8;  // of a point
constexpr double kFollowTolerance = 1e-6;
constexpr int64_t kPointsAtOnce = 256;  // by one thread

struct Candidate {
  std::vector<double> values;
  double cost = 0;
};

// How far a step is trusted.
class TrustRegion {
 public:
  explicit TrustRegion(double radius) : radius_(radius) {}
  double radius() const { return radius_; }
  void Accept(double quality) {
    radius_ = std::min(kMaxRadius, radius_ / std::max(1.0 / 3, 1 - std::pow(2 * quality - 1, 3)));
    decrease_ = 2;
  }
  void Reject() {
    radius_ /= decrease_;
    decrease_ *= 2;
  }
  // For columns of these squared lengths, scaled so.
  template <typename Array>
  Array Damping(const Array& diagonal, const Array& scale) const {
    return (diagonal * scale.square()).max(kMinDiagonal) / (radius_ * scale.square());
  }

 private:
  double radius_, decrease_ = 2;
};

// By how much a step lowers the cost of the linear problem: g^T s + s^T H s / 2 with (H + D) s = -g.
template <typename Vector>
double ExpectedDecrease(const Vector& gradient, const Vector& damping, const Vector& step) {
  return 0.5 * (step.dot(damping.cwiseProduct(step)) - gradient.dot(step));
}

// One point, by all else as it is, which `values` holds: what depends on it alone is minimised as everything
// is.
class PointFollower {
 public:
  PointFollower(const SchurTerms& terms, int point, const std::vector<double>& values)
      : terms_(terms), point_(point), values_(values) {}

  Eigen::Vector3d Follow(Eigen::Vector3d point) {
    Linear linear = Evaluate(point);
    if (!linear.is_possible) return point;
    const Eigen::Array3d scale = (1 + linear.square.diagonal().array().sqrt()).inverse();
    TrustRegion region(SchurSolverOptions().initial_trust_region_radius);
    for (int k = 0; k < kMaxNumStepsOfPoint && region.radius() >= kMinRadius; ++k) {
      const Eigen::Vector3d damping =
          region.Damping<Eigen::Array3d>(linear.square.diagonal().array(), scale).matrix();
      Eigen::Matrix3d damped = linear.square;
      damped.diagonal() += damping;
      const Eigen::Vector3d step = -damped.llt().solve(linear.gradient);
      const double expected = ExpectedDecrease(linear.gradient, damping, step);
      if (!(expected > 0)) return point;
      const Linear moved = Evaluate(point + step);
      if (step.norm() <= kParameterTolerance * (point.norm() + kParameterTolerance) ||
          std::abs(linear.cost - moved.cost) <= kFunctionTolerance * linear.cost)
        return point;
      const double quality = (linear.cost - moved.cost) / expected;
      if (!moved.is_possible || !(quality > kMinQuality)) {
        region.Reject();
        continue;
      }
      point += step;
      linear = moved;
      region.Accept(quality);
    }
    return point;
  }

 private:
  struct Linear {
    bool is_possible = true;
    double cost = 0;
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  };

  Linear Evaluate(const Eigen::Vector3d& point) {
    Linear linear;
    for (const SchurTerms::Use& use : terms_.UsesOfPoint(point_)) {
      const SchurProblem::Residual& residual = terms_.problem().residuals()[use.residual];
      const std::span<const int> blocks = terms_.BlocksOf(use.residual);
      parameters_.clear();
      for (const int b : blocks) parameters_.push_back(&values_[terms_.value_begin(b)]);
      parameters_[use.argument] = point.data();
      const int num_rows = residual.cost->num_residuals();
      residual_.resize(num_rows);
      jacobian_.resize(num_rows, 3);
      jacobians_.assign(blocks.size(), nullptr);
      jacobians_[use.argument] = jacobian_.data();
      if (!residual.cost->Evaluate(parameters_.data(), residual_.data(), jacobians_.data())) {
        linear.is_possible = false;
        linear.cost = std::numeric_limits<double>::infinity();
        return linear;
      }
      const double square = residual_.squaredNorm();
      double rho[3] = {square, 1, 0};
      if (residual.loss != nullptr) residual.loss->Evaluate(square, rho);
      linear.cost += 0.5 * rho[0];
      linear.gradient += rho[1] * jacobian_.transpose() * residual_;
      linear.square += rho[1] * jacobian_.transpose() * jacobian_;
    }
    return linear;
  }

  const SchurTerms& terms_;
  int point_;
  const std::vector<double>& values_;
  std::vector<const double*> parameters_;
  std::vector<double*> jacobians_;
  Eigen::VectorXd residual_;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> jacobian_;
};

class SchurSolver {
 public:
  SchurSolver(const SchurProblem& problem, const SchurSolverOptions& options)
      : problem_(problem),
        options_(options),
        system_(problem, options.num_threads),
        region_(options.initial_trust_region_radius),
        do_points_follow_(options.points_follow) {}

  SchurSummary Solve() {
    // Within bounds.
    values_ = system_.Plus(system_.terms().Values(), Eigen::VectorXd::Zero(system_.gradient().size()));
    const std::optional<double> cost = system_.Linearize(values_);
    if (!cost) return summary_;
    cost_ = summary_.initial_cost = *cost;
    // Columns are as long as they are at the start [Ceres: jacobi_scaling].
    scale_ = (1 + system_.diagonal().array().sqrt()).inverse();
    Iterate();
    summary_.final_cost = cost_;
    summary_.trust_region_radius = region_.radius();
    if (!summary_.was_stopped) system_.terms().Store(values_);
    return summary_;
  }

 private:
  void Iterate() {
    bool is_new = true;  // the gradient
    int num_invalid = 0;
    while (true) {
      if (options_.progress != nullptr && options_.progress->Cancelled()) {
        summary_.was_stopped = true;
        return;
      }
      if (summary_.num_steps >= options_.max_num_iterations) return;
      summary_.has_converged =
          (is_new && LargestGradient() <= options_.gradient_tolerance) || region_.radius() < kMinRadius;
      if (summary_.has_converged) return;
      ++summary_.num_steps;
      if (options_.progress != nullptr) options_.progress->Advance();
      is_new = false;
      Eigen::VectorXd step;
      double expected = FindStep(&step);
      if (!(expected > 0)) {
        if (++num_invalid >= kMaxNumInvalidSteps) return;
        region_.Reject();
        continue;
      }
      num_invalid = 0;
      Candidate candidate = Try(step);
      const bool is_better = do_points_follow_ && LetPointsFollow(&candidate, &expected);
      summary_.has_converged = IsShort(candidate.values) ||
                               std::abs(cost_ - candidate.cost) <= options_.function_tolerance * cost_;
      if (summary_.has_converged) return;
      const double quality = (cost_ - candidate.cost) / expected;
      if (!is_better && !(quality > kMinQuality)) {
        region_.Reject();
        continue;
      }
      const std::optional<double> cost = system_.Linearize(candidate.values);
      if (!cost) return;
      values_ = candidate.values;
      cost_ = *cost;
      is_new = true;
      region_.Accept(quality);
    }
  }

  // The step of the damped problem; returns by how much it lowers the cost of the linear one, or 0.
  double FindStep(Eigen::VectorXd* step) {
    const Eigen::VectorXd damping = region_.Damping<Eigen::ArrayXd>(system_.diagonal().array(), scale_);
    if (!system_.Solve(damping, step) || !step->allFinite()) return 0;
    return ExpectedDecrease(system_.gradient(), damping, *step);
  }

  // Places the candidate's points anew.  What that lowers the cost by was to be expected of the step, too.
  // Returns whether the candidate is better now than what there was.
  bool LetPointsFollow(Candidate* candidate, double* expected) {
    if (!std::isfinite(candidate->cost)) return false;
    const SchurTerms& terms = system_.terms();
    const int64_t num_points = std::ssize(terms.points());
    Candidate followed = *candidate;
    ParallelForRuns(num_points, kPointsAtOnce, options_.num_threads, [&](int64_t begin, int64_t end) {
      for (int64_t p = begin; p < end; ++p) {
        Eigen::Map<Eigen::Vector3d> point(&followed.values[terms.value_begin(terms.points()[p])]);
        point = PointFollower(terms, static_cast<int>(p), candidate->values).Follow(point);
      }
    });
    const std::optional<double> cost = system_.Cost(followed.values);
    if (!cost) return false;
    followed.cost = *cost;
    *expected += candidate->cost - followed.cost;
    do_points_follow_ = 1 - followed.cost / candidate->cost > kFollowTolerance;
    *candidate = std::move(followed);
    return candidate->cost < cost_;
  }

  // The largest change of a value along the gradient, within the bounds.
  double LargestGradient() const {
    const std::vector<double> moved = system_.Plus(values_, -system_.gradient());
    double largest = 0;
    for (size_t i = 0; i < moved.size(); ++i) largest = std::max(largest, std::abs(moved[i] - values_[i]));
    return largest;
  }

  // Infinite where a cost cannot be evaluated.
  Candidate Evaluate(const Eigen::VectorXd& step) {
    Candidate candidate{system_.Plus(values_, step), 0};
    candidate.cost = system_.Cost(candidate.values).value_or(std::numeric_limits<double>::infinity());
    return candidate;
  }

  Candidate Try(const Eigen::VectorXd& step) {
    Candidate candidate = Evaluate(step);
    if (problem_.bounds().empty()) return candidate;
    const double slope = system_.gradient().dot(step);
    const auto falls_enough = [&](const Candidate& tried, double length) {
      return tried.cost <= cost_ + kSufficientDecrease * length * slope;
    };
    double length = 1;
    for (int k = 0; k < kMaxNumContractions && !falls_enough(candidate, length); ++k) {
      // The least of the parabola through both costs and the slope.
      const double bend = candidate.cost - cost_ - length * slope;
      length = std::max(-0.5 * slope * length * length / bend, kMinContraction * length);
      candidate = Evaluate(length * step);
    }
    return falls_enough(candidate, length) ? candidate : Evaluate(step);
  }

  bool IsShort(const std::vector<double>& candidate) const {
    double square = 0, change = 0;
    for (size_t b = 0, i = 0; b < problem_.blocks().size(); ++b) {
      const SchurProblem::Block& block = problem_.blocks()[b];
      for (int k = 0; k < block.size; ++k, ++i) {
        if (block.is_constant) continue;
        square += values_[i] * values_[i];
        change += (candidate[i] - values_[i]) * (candidate[i] - values_[i]);
      }
    }
    return std::sqrt(change) <=
           options_.parameter_tolerance * (std::sqrt(square) + options_.parameter_tolerance);
  }

  const SchurProblem& problem_;
  const SchurSolverOptions& options_;
  SchurSystem system_;
  SchurSummary summary_;
  std::vector<double> values_;
  double cost_ = 0;
  Eigen::ArrayXd scale_;
  TrustRegion region_;
  bool do_points_follow_;
};

}  // namespace

SchurSummary SolveSchur(const SchurProblem& problem, const SchurSolverOptions& options) {
  const SchurSummary summary = SchurSolver(problem, options).Solve();
  if (options.progress != nullptr && !summary.was_stopped)
    options.progress->Advance(options.max_num_iterations - summary.num_steps);
  return summary;
}

}  // namespace cairn
