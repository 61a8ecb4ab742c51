#include "core/structure/schur_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

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

struct Candidate {
  std::vector<double> values;
  double cost = 0;
};

class SchurSolver {
 public:
  SchurSolver(const SchurProblem& problem, const SchurSolverOptions& options)
      : problem_(problem),
        options_(options),
        system_(problem, options.num_threads),
        radius_(options.initial_trust_region_radius) {}

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
    summary_.trust_region_radius = radius_;
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
          (is_new && LargestGradient() <= options_.gradient_tolerance) || radius_ < kMinRadius;
      if (summary_.has_converged) return;
      ++summary_.num_steps;
      if (options_.progress != nullptr) options_.progress->Advance();
      is_new = false;
      Eigen::VectorXd step;
      const double expected = FindStep(&step);
      if (!(expected > 0)) {
        if (++num_invalid >= kMaxNumInvalidSteps) return;
        Reject();
        continue;
      }
      num_invalid = 0;
      const Candidate candidate = Try(step);
      summary_.has_converged = IsShort(candidate.values) ||
                               std::abs(cost_ - candidate.cost) <= options_.function_tolerance * cost_;
      if (summary_.has_converged) return;
      const double quality = (cost_ - candidate.cost) / expected;
      if (!(quality > kMinQuality)) {
        Reject();
        continue;
      }
      const std::optional<double> cost = system_.Linearize(candidate.values);
      if (!cost) return;
      values_ = candidate.values;
      cost_ = *cost;
      is_new = true;
      radius_ = std::min(kMaxRadius, radius_ / std::max(1.0 / 3, 1 - std::pow(2 * quality - 1, 3)));
      decrease_ = 2;
    }
  }

  void Reject() {
    radius_ /= decrease_;
    decrease_ *= 2;
  }

  // The step of the damped problem; returns by how much it lowers the cost of the linear one, or 0.
  double FindStep(Eigen::VectorXd* step) {
    const Eigen::ArrayXd scaled = (system_.diagonal().array() * scale_.square()).max(kMinDiagonal);
    const Eigen::VectorXd damping = scaled / (radius_ * scale_.square());
    if (!system_.Solve(damping, step) || !step->allFinite()) return 0;
    // g^T s + s^T H s / 2 with (H + D) s = -g.
    return 0.5 * (step->dot(damping.cwiseProduct(*step)) - system_.gradient().dot(*step));
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
  double radius_, decrease_ = 2;
};

}  // namespace

SchurSummary SolveSchur(const SchurProblem& problem, const SchurSolverOptions& options) {
  const SchurSummary summary = SchurSolver(problem, options).Solve();
  if (options.progress != nullptr) options.progress->Advance(options.max_num_iterations - summary.num_steps);
  return summary;
}

}  // namespace cairn
