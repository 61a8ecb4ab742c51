#include "runtime/visual_map/visual_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/camera/camera_turn.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

constexpr double kVoteBinRad = 2 * std::numbers::pi / 180;
// The first step assumes errors larger by this factor.
constexpr double kFirstStepScale = 3;
// Largest width of a turn that no item determines.
constexpr double kWidestTurnRad = 1;

}  // namespace

ItemScore ScoreItem(const FitItem& item, const Eigen::Vector3d& error) {
  // [Sala06 §VI-C] one landmark's factor of p(z | x), (1 - o) N(z; model(x), S) + o U, over o U
  const double log_odds = item.log_odds - 0.5 * (error.array().square() / item.variance.array()).sum();
  if (log_odds > 30) return {log_odds, 1};
  const double odds = std::exp(log_odds);
  return {std::log1p(odds), odds / (1 + odds)};
}

Eigen::Vector3d LiftedPrediction(const FitItem& item, double higher_m) {
  return item.predicted + Eigen::Vector3d(0, item.rise * higher_m, 0);
}

bool ItemError(const FitItem& item, const Eigen::Matrix3d& turn, double higher_m, double focal_px,
               Eigen::Vector3d* error, Eigen::Matrix<double, 3, 4>* jacobian) {
  const Eigen::Vector3d lifted = LiftedPrediction(item, higher_m);
  const auto shown = TurnedSight(lifted, turn, focal_px);
  if (!shown) return false;
  *error = *shown - item.seen;
  const double x = shown->x() / focal_px, y = shown->y() / focal_px;
  jacobian->leftCols<3>() << 1 + x * x, x * y, y, x * y, 1 + y * y, -x, 0, 0, 0;
  jacobian->leftCols<3>() *= focal_px;
  jacobian->col(3) = item.rise * TurnGradient(lifted, turn, focal_px).col(1);
  return true;
}

Eigen::Matrix3d TurnGradient(const Eigen::Vector3d& predicted, const Eigen::Matrix3d& turn, double focal_px) {
  const Eigen::Vector3d ray = turn * Eigen::Vector3d(predicted.x() / focal_px, predicted.y() / focal_px, 1);
  Eigen::Matrix3d gradient = Eigen::Matrix3d::Identity();
  gradient.topLeftCorner<2, 2>() =
      (turn.topLeftCorner<2, 2>() - ray.head<2>() / ray.z() * turn.block<1, 2>(2, 0)) / ray.z();
  return gradient;
}

double VoteForLeft(const std::vector<FitItem>& items, const TurnFitOptions& options) {
  const int reach = static_cast<int>(std::ceil(options.max_left_rad / kVoteBinRad));
  std::vector<double> votes(2 * reach + 3, 0), sums(2 * reach + 3, 0);
  for (const FitItem& item : items) {
    const double left =
        std::atan(item.seen.x() / options.focal_px) - std::atan(item.predicted.x() / options.focal_px);
    if (std::abs(left) > options.max_left_rad) continue;
    const auto bin = static_cast<size_t>(std::lround(left / kVoteBinRad) + reach + 1);
    votes[bin] += 1;
    sums[bin] += left;
  }
  const auto around = [](const std::vector<double>& values, size_t i) {
    return values[i - 1] + values[i] + values[i + 1];
  };
  size_t best = reach + 1;
  for (size_t bin = 1; bin + 1 < votes.size(); ++bin) {
    if (around(votes, bin) + votes[bin] > around(votes, best) + votes[best]) best = bin;
  }
  return around(votes, best) > 0 ? around(sums, best) / around(votes, best) : 0;
}

double LogTurnPrior(const TurnFitOptions& options) {
  return -2.5 * std::log(2 * std::numbers::pi) - 2 * std::log(options.tilt_sigma_rad) -
         std::log(options.height_sigma_m);
}

double FitTurn(const std::vector<FitItem>& items, const TurnFitOptions& options, int num_steps, Turn* turn) {
  const double tilt_weight = 1 / (options.tilt_sigma_rad * options.tilt_sigma_rad);
  const double height_weight = 1 / (options.height_sigma_m * options.height_sigma_m);
  const Eigen::Vector4d weights(0, tilt_weight, tilt_weight, height_weight);
  const Eigen::Vector4d least(1 / (kWidestTurnRad * kWidestTurnRad), 0, 0, 0);
  for (int step = 0;; ++step) {
    const Eigen::Matrix3d rotation = CameraTurn(turn->left, turn->up, turn->clockwise);
    const bool is_last = step == num_steps;
    const double scale = step == 0 && !is_last ? kFirstStepScale : 1;
    const Eigen::Vector4d at(turn->left, turn->up, turn->clockwise, turn->higher_m);
    Eigen::Matrix4d normal = (weights + least).asDiagonal();
    Eigen::Vector4d gradient = weights.cwiseProduct(at);
    double log_ratio = -0.5 * gradient.dot(at);
    Eigen::Vector3d error;
    Eigen::Matrix<double, 3, 4> jacobian;
    for (const FitItem& item : items) {
      if (!ItemError(item, rotation, turn->higher_m, options.focal_px, &error, &jacobian)) continue;
      const ItemScore score = ScoreItem(item, error / scale);
      log_ratio += score.log_ratio;
      if (score.weight < 1e-6) continue;
      const Eigen::Vector3d weight = score.weight * item.variance.cwiseInverse();
      normal += jacobian.transpose() * weight.asDiagonal() * jacobian;
      gradient += jacobian.transpose() * weight.asDiagonal() * error;
    }
    if (is_last) {
      return log_ratio + LogTurnPrior(options) + 2 * std::log(2 * std::numbers::pi) -
             0.5 * std::log(normal.determinant());
    }
    const Eigen::Vector4d change = -normal.ldlt().solve(gradient);
    turn->left = std::clamp(turn->left + change[0], -options.max_left_rad, options.max_left_rad);
    turn->up = std::clamp(turn->up + change[1], -0.5, 0.5);
    turn->clockwise = std::clamp(turn->clockwise + change[2], -0.5, 0.5);
    turn->higher_m += change[3];
  }
}

}  // namespace cairn
