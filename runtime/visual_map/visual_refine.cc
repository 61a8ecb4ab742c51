#include "runtime/visual_map/visual_refine.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/camera/camera_turn.h"

namespace cairn {
namespace {

constexpr int kNumPoseSteps = 12;
// The first steps assume larger errors: by this factor, halved from step to step.
constexpr double kFirstRefineScale = 8;

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// x, y, left, up, clockwise, higher around a pose.
struct NormalEquations {
  Matrix6d normal;
  Vector6d gradient;
};

class Refiner {
 public:
  Refiner(const VisualMap& map, const VisualSearch& search) : map_(map), search_(search) {
    const double tilt = search.fit().tilt_sigma_rad, height = search.fit().height_sigma_m;
    weights_ << 0, 0, 0, 1 / (tilt * tilt), 1 / (tilt * tilt), 1 / (height * height);
    least_ << 1e-4, 1e-4, 1, 0, 0, 0;
  }

  std::optional<DensityMaximum> Run(const VisualHypothesis& start) const {
    DensityMaximum refined{
        .start = start, .position = map_.places()[start.place] + start.offset, .turn = start.turn};
    for (int step = 0; step < kNumPoseSteps; ++step) {
      const NormalEquations equations =
          Linearise(std::max(1.0, std::ldexp(kFirstRefineScale, -step)), &refined);
      const Vector6d change = -equations.normal.ldlt().solve(equations.gradient);
      if (!change.allFinite()) return std::nullopt;
      Step(change, &refined);
    }
    const Matrix6d normal = Linearise(1, &refined).normal;
    const Matrix6d inverse = normal.inverse();
    if (!inverse.allFinite()) return std::nullopt;
    refined.covariance = inverse.topLeftCorner<3, 3>();
    // A place of the survey stands for an area of the square of its spacing.
    refined.log_mass = search_.LogMassWithoutMatches(start.place) - 2 * std::log(map_.spacing_m()) +
                       LogTurnPrior(search_.fit()) + refined.log_density +
                       3 * std::log(2 * std::numbers::pi) - 0.5 * std::log(normal.determinant());
    return refined;
  }

 private:
  // Also counts agreeing matches.  `scale`: factor on the assumed errors.
  NormalEquations Linearise(double scale, DensityMaximum* refined) const {
    const TurnFitOptions& fit = search_.fit();
    const Turn& turn = refined->turn;
    const Eigen::Matrix3d rotation = CameraTurn(turn.left, turn.up, turn.clockwise);
    Vector6d at;
    at << 0, 0, 0, turn.up, turn.clockwise, turn.higher_m;
    NormalEquations equations{(weights_ + least_).asDiagonal(), weights_.cwiseProduct(at)};
    refined->log_density = -0.5 * equations.gradient.dot(at);
    refined->agreeing.clear();
    for (const VisualTerm& term : search_.TermsOf(refined->start)) {
      const LandmarkModel::Prediction prediction = term.model->interpolation.Predict(refined->position);
      const FitItem item = search_.MakeItem(term, prediction, refined->position);
      Eigen::Vector3d error;
      Eigen::Matrix<double, 3, 4> by_turn;
      if (!ItemError(item, rotation, turn.higher_m, fit.focal_px, &error, &by_turn)) continue;
      const ItemScore score = ScoreItem(item, error / scale);
      refined->log_density += score.log_ratio;
      if (score.weight > 0.5) refined->agreeing.push_back(term.match);
      Eigen::Matrix<double, 3, 6> jacobian;
      jacobian << TurnGradient(LiftedPrediction(item, turn.higher_m), rotation, fit.focal_px) *
                      prediction.gradient,
          by_turn;
      const Eigen::Vector3d weight = score.weight * item.variance.cwiseInverse();
      equations.normal += jacobian.transpose() * weight.asDiagonal() * jacobian;
      equations.gradient += jacobian.transpose() * weight.asDiagonal() * error;
    }
    return equations;
  }

  void Step(Vector6d change, DensityMaximum* refined) const {
    const double way_m = change.head<2>().norm();
    if (way_m > map_.spacing_m()) change *= map_.spacing_m() / way_m;
    refined->position += change.head<2>();
    refined->turn.left += change[2];
    refined->turn.up = std::clamp(refined->turn.up + change[3], -0.5, 0.5);
    refined->turn.clockwise = std::clamp(refined->turn.clockwise + change[4], -0.5, 0.5);
    refined->turn.higher_m += change[5];
  }

  const VisualMap& map_;
  const VisualSearch& search_;
  Vector6d weights_;  // of the prior
  Vector6d least_;    // keeps the system solvable
};

}  // namespace

std::optional<DensityMaximum> RefinePose(const VisualMap& map, const VisualSearch& search,
                                         const VisualHypothesis& start) {
  return Refiner(map, search).Run(start);
}

}  // namespace cairn
