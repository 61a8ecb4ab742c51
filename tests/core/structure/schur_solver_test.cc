#include "core/structure/schur_solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(SchurSolver, NothingIsSolved) {
  const SchurSummary summary = SolveSchur(SchurProblem(), {.gradient_tolerance = 0});
  EXPECT_TRUE(summary.has_converged);
  EXPECT_EQ(summary.num_steps, 0);
  EXPECT_EQ(summary.final_cost, 0);
}

// One residual r(x) of one parameter from x = 0, with dr/dx where it starts and everywhere else; nothing
// where r is infinite.  Keeps where it was evaluated.
class Curve : public ceres::SizedCostFunction<1, 1> {
 public:
  Curve(std::function<double(double)> residual, double slope)
      : residual_(std::move(residual)), slope_(slope) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    tried.push_back(parameters[0][0]);
    residuals[0] = residual_(tried.back());
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = slope_;
    return std::isfinite(residuals[0]);
  }

  mutable std::vector<double> tried;

 private:
  std::function<double(double)> residual_;
  double slope_;
};

struct CurveSolution {
  SchurSummary summary;
  double x = 0;
  std::vector<double> tried;
};

CurveSolution SolveCurve(const std::function<double(double)>& residual, SchurSolverOptions options = {},
                         double bound = 0, double slope = -1, double start = 0) {
  const Curve curve(residual, slope);
  CurveSolution solution;
  solution.x = start;
  SchurProblem problem;
  const int block = problem.AddBlock(&solution.x, 1);
  if (bound != 0) problem.SetBounds(block, 0, -bound, bound);
  problem.AddResidual(&curve, nullptr, {block});
  options.num_threads = 1;
  solution.summary = SolveSchur(problem, options);
  solution.tried = curve.tried;
  return solution;
}

// The first step goes from 0 to 1 / (1 + 1e-16), as the line would.
SchurSolverOptions OneStep() { return {.max_num_iterations = 1, .initial_trust_region_radius = 1e15}; }

// r of x = 1 for which the cost falls by a part of the 1/2 that the line promises.
std::function<double(double)> OfQuality(double quality) {
  return [quality](double x) { return x == 0 ? 1 : std::sqrt(1 - quality); };
}

TEST(SchurSolver, AStepMustLowerTheCostByAThousandthOfWhatItPromises) {
  EXPECT_NEAR(SolveCurve(OfQuality(0.0012), OneStep()).x, 1, 1e-12);
  EXPECT_EQ(SolveCurve(OfQuality(0.0008), OneStep()).x, 0);
  EXPECT_NEAR(SolveCurve(OfQuality(0.0008), OneStep()).summary.trust_region_radius, 0.5e15, 1e3);
  EXPECT_EQ(SolveCurve(OfQuality(0.0008), OneStep()).summary.num_steps, 1);
}

TEST(SchurSolver, TrustGrowsWithQuality) {
  EXPECT_NEAR(SolveCurve(OfQuality(1), OneStep()).summary.trust_region_radius, 3e15, 1e6);
  EXPECT_NEAR(SolveCurve(OfQuality(0.75), OneStep()).summary.trust_region_radius, 1e15 / 0.875, 1e6);
  EXPECT_NEAR(SolveCurve(OfQuality(0.25), OneStep()).summary.trust_region_radius, 1e15 / 1.125, 1e6);
  SchurSolverOptions large = OneStep();
  large.initial_trust_region_radius = 6e15;
  EXPECT_EQ(SolveCurve(OfQuality(1), large).summary.trust_region_radius, 1e16);
}

TEST(SchurSolver, TrustShrinksTwiceAsMuchEachTime) {
  const auto worse = [](double x) { return x == 0 ? 1.0 : 2.0; };
  SchurSolverOptions options = OneStep();
  options.max_num_iterations = 3;
  const SchurSummary summary = SolveCurve(worse, options).summary;
  EXPECT_EQ(summary.num_steps, 3);
  EXPECT_FALSE(summary.has_converged);
  EXPECT_EQ(summary.trust_region_radius, 1e15 / (2 * 4 * 8));
  // After a step that was accepted it starts anew: rejected, accepted, rejected, with the least change
  // between.
  int num_evaluated = 0;
  const auto up_and_down = [&](double) {
    constexpr double kResiduals[] = {1, 2, 0.5, 0.5, 2};
    return kResiduals[num_evaluated++];
  };
  const CurveSolution solution = SolveCurve(up_and_down, options);
  EXPECT_EQ(num_evaluated, 5);
  EXPECT_NEAR(solution.summary.trust_region_radius, 1e15 / 2 / (1 - 0.125) / 2, 1e6);
}

TEST(SchurSolver, WithoutTrustItEnds) {
  const auto worse = [](double x) { return x == 0 ? 1.0 : 2.0; };
  const CurveSolution ended = SolveCurve(worse, {.initial_trust_region_radius = 0.9e-32});
  EXPECT_TRUE(ended.summary.has_converged);
  EXPECT_EQ(ended.summary.num_steps, 0);
  const SchurSolverOptions small = {.parameter_tolerance = 0, .initial_trust_region_radius = 1.1e-32};
  EXPECT_EQ(SolveCurve(worse, small).summary.num_steps, 1);
}

TEST(SchurSolver, EndsWhereNothingChangesMuch) {
  // The cost falls by 1 / 10 of itself, or by nearly that.
  const auto falls = [](double x) { return x == 0 ? 1 : std::sqrt(0.9); };
  SchurSolverOptions options = OneStep();
  options.function_tolerance = 0.11;
  EXPECT_TRUE(SolveCurve(falls, options).summary.has_converged);
  EXPECT_EQ(SolveCurve(falls, options).x, 0);  // as Ceres: what is nearly the same is not taken
  EXPECT_EQ(SolveCurve(falls, options).summary.final_cost, 0.5);
  options.function_tolerance = 0.09;
  EXPECT_FALSE(SolveCurve(falls, options).summary.has_converged);
  // A step of 1 at x = 7: an eighth is 7 / 8 + 1 / 64.
  const auto line = [](double x) { return x == 7 ? 1 : std::sqrt(0.5); };
  options.parameter_tolerance = 0.141;  // times 7.141: 1.007
  EXPECT_TRUE(SolveCurve(line, options, 0, -1, 7).summary.has_converged);
  options.parameter_tolerance = 0.139;  // times 7.139: 0.992
  EXPECT_FALSE(SolveCurve(line, options, 0, -1, 7).summary.has_converged);
  // A gradient of 1.
  options.gradient_tolerance = 1.01;
  EXPECT_EQ(SolveCurve(line, options, 0, -1, 7).summary.num_steps, 0);
  EXPECT_TRUE(SolveCurve(line, options, 0, -1, 7).summary.has_converged);
  options.gradient_tolerance = 0.99;
  EXPECT_EQ(SolveCurve(line, options, 0, -1, 7).summary.num_steps, 1);
}

TEST(SchurSolver, AtABoundThereIsNowhereToGo) {
  const auto line = [](double x) { return 10 - x; };
  const CurveSolution solution = SolveCurve(line, {}, 3, -1, 5);
  EXPECT_EQ(solution.x, 3);  // brought within its bounds
  EXPECT_TRUE(solution.summary.has_converged);
  EXPECT_EQ(solution.summary.num_steps, 0);
  EXPECT_EQ(SolveCurve(line, {}, 3).x, 3);
}

TEST(SchurSolver, AStepWithBoundsThatDoesNotHelpIsShortened) {
  // The parabola through costs of 1/2 and 2 with a slope of -1 is least at 0.5 / (2 - 0.5 + 1).
  const auto bowl = [](double x) { return x > 0.5 ? 2 : 1 - x; };
  const CurveSolution solution = SolveCurve(bowl, OneStep(), 10);
  ASSERT_GE(solution.tried.size(), 3u);
  EXPECT_NEAR(solution.tried[1], 1, 1e-12);
  EXPECT_NEAR(solution.tried[2], 0.2, 1e-12);
  EXPECT_NEAR(solution.x, 0.2, 1e-12);
  // Without bounds it is not.
  EXPECT_EQ(SolveCurve(bowl, OneStep()).x, 0);
}

TEST(SchurSolver, AStepIsShortenedFromWhereItWas) {
  // 1, then 0.2, where the cost is 1/2 + 0.3: 0.5 * 0.2^2 / (0.3 + 0.2) = 0.04.
  const auto bowl = [](double x) { return x > 0.5 ? 2 : x > 0.1 ? std::sqrt(1.6) : 1 - x; };
  const CurveSolution solution = SolveCurve(bowl, OneStep(), 10);
  ASSERT_GE(solution.tried.size(), 4u);
  EXPECT_NEAR(solution.tried[3], 0.04, 1e-12);
  EXPECT_NEAR(solution.x, 0.04, 1e-12);
}

TEST(SchurSolver, AStepWithBoundsMustLowerTheCostByAPartOfItsSlope) {
  // By 1e-4 of what the gradient promises, 1.
  const auto falls = [](double by) {
    return [by](double x) { return x == 0 ? 1 : x > 0.9 ? std::sqrt(1 - 2 * by) : 0.5; };
  };
  const SchurSolverOptions options = {
      .max_num_iterations = 1, .function_tolerance = 0, .initial_trust_region_radius = 1e15};
  EXPECT_EQ(SolveCurve(falls(1.2e-4), options, 10).tried.size(), 2u);
  EXPECT_EQ(SolveCurve(falls(0.8e-4), options, 10).tried.size(), 4u);
}

TEST(SchurSolver, AStepIsShortenedToAThousandthAtMostEachTime) {
  const auto steep = [](double x) { return x > 0.5 ? 1000 : 1 - x; };
  EXPECT_NEAR(SolveCurve(steep, OneStep(), 10).tried[2], 0.001, 1e-12);
  // 20 times; where nothing helps, the step is what it was.
  const auto wall = [](double x) { return x == 0 ? 1 : std::numeric_limits<double>::infinity(); };
  const CurveSolution solution = SolveCurve(wall, OneStep(), 10);
  ASSERT_EQ(solution.tried.size(), 23u);
  EXPECT_NEAR(solution.tried[22], 1, 1e-12);
  EXPECT_EQ(solution.x, 0);
}

TEST(SchurSolver, WhatCannotBeEvaluatedIsNotGoneTo) {
  const auto wall = [](double x) { return x > 0.5 ? std::numeric_limits<double>::infinity() : 1 - x; };
  const CurveSolution solution = SolveCurve(wall, {.max_num_iterations = 100});
  EXPECT_GT(solution.x, 0.3);
  EXPECT_LE(solution.x, 0.5);
  const auto nowhere = [](double) { return std::numeric_limits<double>::infinity(); };
  EXPECT_FALSE(SolveCurve(nowhere).summary.has_converged);
  EXPECT_EQ(SolveCurve(nowhere).tried, std::vector<double>{0});
}

TEST(SchurSolver, FiveStepsThatPromiseNothingAreEnough) {
  // So flat that squares of the slope are zero.
  const auto flat = [](double) { return 1.0; };
  const CurveSolution solution = SolveCurve(flat, {.gradient_tolerance = 0}, 0, -1e-200);
  EXPECT_EQ(solution.summary.num_steps, 5);
  EXPECT_FALSE(solution.summary.has_converged);
  EXPECT_EQ(solution.x, 0);
}

// The residual x + y + z - 1 of three parameters.
class Sum : public ceres::SizedCostFunction<1, 3> {
 public:
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = parameters[0][0] + parameters[0][1] + parameters[0][2] - 1;
    if (jacobians != nullptr && jacobians[0] != nullptr) std::fill_n(jacobians[0], 3, 1.0);
    return true;
  }
};

TEST(SchurSolver, WhatIsNotDeterminedIsDamped) {
  const Sum sum;
  for (const bool is_point : {false, true}) {
    std::array<double, 3> values = {0, 0, 0};
    SchurProblem problem;
    const int block = is_point ? problem.AddPoint(values.data()) : problem.AddBlock(values.data(), 3);
    problem.AddResidual(&sum, nullptr, {block});
    EXPECT_TRUE(SolveSchur(problem, {}).has_converged);
    for (const double value : values) EXPECT_NEAR(value, 1.0 / 3, 1e-6);
    // So little damping is none, once it is rounded: there is no step, five times.
    values = {0, 0, 0};
    const SchurSummary summary = SolveSchur(problem, {.initial_trust_region_radius = 1e25});
    EXPECT_FALSE(summary.has_converged);
    EXPECT_EQ(summary.num_steps, 5);
    EXPECT_EQ(summary.trust_region_radius, 1e25 / (2 * 4 * 8 * 16));
    EXPECT_EQ(values[0], 0);
  }
}

TEST(SchurSolver, ASlopeThatIsNoNumberIsNotGoneAlong) {
  const auto flat = [](double) { return 1.0; };
  const CurveSolution solution = SolveCurve(flat, {}, 0, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(solution.summary.num_steps, 0);
  EXPECT_FALSE(solution.summary.has_converged);
  EXPECT_EQ(solution.x, 0);
}

TEST(SchurSolver, DampingHasALeastValue) {
  // A slope of 1e-4: its square, 1e-8, is damped as 1e-6 would be, here by a hundredth of that.
  const auto line = [](double x) { return 1 - 1e-4 * x; };
  const CurveSolution solution =
      SolveCurve(line, {.max_num_iterations = 1, .initial_trust_region_radius = 100}, 0, -1e-4);
  ASSERT_GE(solution.tried.size(), 2u);
  EXPECT_NEAR(solution.tried[1], 5000, 5);
}

}  // namespace
}  // namespace cairn
