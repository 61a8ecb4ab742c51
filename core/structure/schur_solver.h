#pragma once

#include "core/base/progress.h"
#include "core/structure/schur_problem.h"

namespace cairn {

// Least and most are Ceres' defaults, as is all that is no option.
struct SchurSolverOptions {
  int max_num_iterations = 50;
  // Converged where a step changes the cost by less than this part.
  double function_tolerance = 1e-6;
  // Converged where no parameter's gradient is larger.
  double gradient_tolerance = 1e-10;
  // Converged where a step is shorter than this part of all parameters.
  double parameter_tolerance = 1e-8;
  // How far the first step is trusted: the less, the more it is damped.  REQUIRES: > 0
  double initial_trust_region_radius = 1e4;
  // Each point is placed anew by what a step makes of all else before the step is judged, until that lowers
  // the cost by less than a millionth: otherwise a few points that are weakly determined make it fail for all
  // [Ceres, "Inner iterations"].
  bool points_follow = false;
  // The result does not depend on it.
  int num_threads = 0;
  // Advanced by max_num_iterations: by 1 for each, and at the end by what is left, unless it is cancelled.
  // Then the solver ends.  Null: nothing is.
  Progress* progress = nullptr;
};

struct SchurSummary {
  double initial_cost = 0, final_cost = 0;
  int num_steps = 0;  // tried
  bool has_converged = false;
  bool was_stopped = false;
  double trust_region_radius = 0;  // at the end
};

// Minimises a sum of squares over points and other blocks by Levenberg and Marquardt's method, with points
// eliminated (core/structure/schur_system.h).  Steps, their damping, their acceptance and the end are those
// of Ceres' trust region [Ceres, "Levenberg-Marquardt", after Madsen04]: diag(J^T J) / radius is the damping,
//   radius /= max(1/3, 1 - (2 q - 1)^3)
// after a step of quality q, the change of the cost beside what was expected of it; after a step that is not
// accepted the radius shrinks, each time by twice as much.  Steps are cut off at bounds; a step so cut, where
// the cost does not fall as the gradient promises, is shortened [Nocedal06 §3.5].
//
// Values are those of the least cost found; they stay where the solver is stopped, or no cost can be
// evaluated at the start.  The same result, to the bit, for any number of threads.
//   Madsen04: Methods for non-linear least squares problems.  Nocedal06: Numerical optimization.
SchurSummary SolveSchur(const SchurProblem& problem, const SchurSolverOptions& options);

}  // namespace cairn
