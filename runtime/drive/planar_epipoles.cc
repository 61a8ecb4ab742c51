#include "runtime/drive/planar_epipoles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/base/random.h"

namespace cairn {
namespace {

// Errors beyond this many standard deviations are outliers.
constexpr double kMaxSigmas = 3;
// Factors of the assumed focal length that samples try, in units of its standard deviation.
constexpr std::array<double, 5> kFocalSteps = {0, -0.8, 0.8, -1.6, 1.6};
// Rays further off the axis are not image points.
constexpr double kMaxTangent = 1000;
constexpr int kNumRefined = 3;
constexpr int kNumRefinements = 12;

// psi, delta = phi + pi, log(kappa).
using Motion = Eigen::Vector3d;

// The constraint of one motion.
class Constraint {
 public:
  explicit Constraint(const Motion& motion)
      : kappa_(std::exp(motion[2])),
        cos_psi_(std::cos(motion[0])),
        sin_psi_(std::sin(motion[0])),
        cos_delta_(std::cos(motion[1])),
        sin_delta_(std::sin(motion[1])) {}

  struct Terms {
    double error = 0, variance = 0;  // the latter for pixels of variance 1
    double SquaredError() const { return error * error / std::max(variance, 1e-12); }
  };
  Terms Evaluate(const RayPair& pair) const {
    const double yc = pair.current.y(), yt = pair.target.y();
    const double current_side = kappa_ * pair.current.x() * cos_psi_ + sin_psi_;
    const double target_side = kappa_ * pair.target.x() * cos_delta_ + sin_delta_;
    const double along_xc = kappa_ * yt * cos_psi_, along_xt = kappa_ * yc * cos_delta_;
    // [Mariottini11 §V-A] the epipoles from matches alone: by planar motion, not by a fundamental matrix
    return {
        yt * current_side - yc * target_side,
        along_xc * along_xc + along_xt * along_xt + current_side * current_side + target_side * target_side};
  }
  // Of the error, by psi, delta and log(kappa).
  Eigen::Vector3d Gradient(const RayPair& pair) const {
    const double xc = kappa_ * pair.current.x(), xt = kappa_ * pair.target.x();
    const double yc = pair.current.y(), yt = pair.target.y();
    return {yt * (cos_psi_ - xc * sin_psi_), -yc * (cos_delta_ - xt * sin_delta_),
            yt * xc * cos_psi_ - yc * xt * cos_delta_};
  }

 private:
  double kappa_, cos_psi_, sin_psi_, cos_delta_, sin_delta_;
};

class Estimator {
 public:
  Estimator(const std::vector<RayPair>& pairs, double focal_px, const PlanarEpipolesOptions& options)
      : options_(options), inverse_sigma_(focal_px / options.noise_px) {
    for (size_t i = 0; i < pairs.size(); ++i) {
      if (!IsUsable(pairs[i].current) || !IsUsable(pairs[i].target)) continue;
      pairs_.push_back(pairs[i]);
      index_.push_back(i);
    }
  }

  static bool IsUsable(const Eigen::Vector2d& ray) { return ray.allFinite() && ray.norm() < kMaxTangent; }

  size_t num_pairs() const { return pairs_.size(); }
  const std::vector<RayPair>& pairs() const { return pairs_; }
  const std::vector<size_t>& index() const { return index_; }

  // Squared Sampson error that separates outliers, in units of the focal length.
  double MaxSquaredError() const {
    const double limit = kMaxSigmas / inverse_sigma_;
    return limit * limit;
  }

  // Truncated sum of squares, plus the deviation of the focal length from the assumed one.
  double Cost(const Motion& motion) const {
    const Constraint constraint(motion);
    const double limit = MaxSquaredError();
    double sum = 0;
    for (const RayPair& pair : pairs_) sum += std::min(constraint.Evaluate(pair).SquaredError(), limit);
    return inverse_sigma_ * inverse_sigma_ * sum + FocalWeight() * FocalOffset(motion) * FocalOffset(motion);
  }

  // Standard deviation of log(kappa).
  double FocalError(const Motion& motion) const {
    const Eigen::Matrix3d covariance = NormalEquations(motion).hessian.inverse();
    return covariance.allFinite() ? std::sqrt(std::max(0.0, covariance(2, 2))) : options_.focal_error_ratio;
  }

  Motion Best(const PlanarEpipoles* previous) const {
    std::vector<std::pair<double, Motion>> found;
    const auto add = [&](const Motion& motion) { found.emplace_back(Cost(motion), motion); };
    if (previous != nullptr) {
      add({previous->psi_rad, previous->phi_rad + std::numbers::pi, std::log(previous->focal_ratio)});
    }
    add({0, 0, std::log(options_.focal_ratio)});
    Random random(MixSeed(options_.seed, pairs_.size()));
    const auto last = static_cast<int64_t>(pairs_.size()) - 1;
    for (int s = 0; s < options_.num_samples; ++s) {
      const RayPair& a = pairs_[random.UniformInt(0, last)];
      const RayPair& b = pairs_[random.UniformInt(0, last)];
      const double log_kappa =
          std::log(options_.focal_ratio) + options_.focal_error_ratio * kFocalSteps[s % kFocalSteps.size()];
      for (const Motion& motion : SolveTwo(a, b, log_kappa)) add(motion);
    }
    const auto less = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::stable_sort(found.begin(), found.end(), less);
    if (found.size() > kNumRefined) found.resize(kNumRefined);
    for (auto& [cost, motion] : found) {
      motion = Refined(motion);
      cost = Cost(motion);
    }
    return std::min_element(found.begin(), found.end(), less)->second;
  }

 private:
  double FocalWeight() const { return 1 / (options_.focal_error_ratio * options_.focal_error_ratio); }
  double FocalOffset(const Motion& motion) const { return motion[2] - std::log(options_.focal_ratio); }

  // Normal equations of one step: over the inliers, with the prior of the focal length.
  struct Normal {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  };
  Normal NormalEquations(const Motion& motion) const {
    Normal normal;
    const Constraint constraint(motion);
    for (const RayPair& pair : pairs_) {
      const Constraint::Terms terms = constraint.Evaluate(pair);
      if (terms.SquaredError() > MaxSquaredError()) continue;
      const double weight = inverse_sigma_ * inverse_sigma_ / std::max(terms.variance, 1e-12);
      const Eigen::Vector3d derivative = constraint.Gradient(pair);
      normal.hessian += weight * derivative * derivative.transpose();
      normal.gradient += weight * terms.error * derivative;
    }
    normal.hessian(2, 2) += FocalWeight();
    normal.gradient[2] += FocalWeight() * FocalOffset(motion);
    normal.hessian.diagonal().array() += 1e-9;
    return normal;
  }

  // Two matches and kappa: A (cos psi, sin psi) = B (cos delta, sin delta); M = A^-1 B keeps the length of
  // that vector, u' (M'M - 1) u = 0.  None, or two motions up to the sign of both vectors.
  static std::vector<Motion> SolveTwo(const RayPair& a, const RayPair& b, double log_kappa) {
    const double kappa = std::exp(log_kappa);
    Eigen::Matrix2d current_side, target_side;
    current_side << a.target.y() * kappa * a.current.x(), a.target.y(), b.target.y() * kappa * b.current.x(),
        b.target.y();
    target_side << a.current.y() * kappa * a.target.x(), a.current.y(), b.current.y() * kappa * b.target.x(),
        b.current.y();
    if (!(std::abs(current_side.determinant()) > 1e-9)) return {};
    const Eigen::Matrix2d m = current_side.inverse() * target_side;
    const Eigen::Matrix2d q = m.transpose() * m - Eigen::Matrix2d::Identity();
    // q00 c^2 + 2 q01 c s + q11 s^2 = mean + difference cos(2 delta) + q01 sin(2 delta) = 0
    const double mean = 0.5 * (q(0, 0) + q(1, 1)), difference = 0.5 * (q(0, 0) - q(1, 1));
    const double amplitude = std::hypot(difference, q(0, 1));
    if (!(std::abs(mean) <= amplitude)) return {};
    const double phase = std::atan2(q(0, 1), difference), half = std::acos(-mean / amplitude);
    std::vector<Motion> motions;
    for (const double twice : {phase + half, phase - half}) {
      const double delta = 0.5 * twice;
      const Eigen::Vector2d direction = m * Eigen::Vector2d(std::cos(delta), std::sin(delta));
      motions.push_back({std::atan2(direction.y(), direction.x()), delta, log_kappa});
    }
    return motions;
  }

  // Damped Gauss-Newton over the inliers, chosen again at each step.
  Motion Refined(Motion motion) const {
    double damping = 1e-3, cost = Cost(motion);
    for (int step = 0; step < kNumRefinements; ++step) {
      Normal normal = NormalEquations(motion);
      normal.hessian.diagonal() *= 1 + damping;
      const Motion moved = motion - normal.hessian.ldlt().solve(normal.gradient);
      const double moved_cost = moved.allFinite() ? Cost(moved) : std::numeric_limits<double>::infinity();
      if (moved_cost < cost) {
        const bool small = cost - moved_cost < 1e-6 * cost;
        motion = moved, cost = moved_cost, damping *= 0.1;
        if (small) break;
      } else {
        damping *= 10;
      }
    }
    return motion;
  }

  const PlanarEpipolesOptions& options_;
  const double inverse_sigma_;
  std::vector<RayPair> pairs_;  // finite ones
  std::vector<size_t> index_;   // of these among all
};

// The baseline over the point's distance from the target, and how well it is known (1 / sigma, up to a
// factor): along the baseline by the ratio of the elevations, beside it by the difference of the bearings.
// Negative for a baseline the wrong way round.
std::pair<double, double> DistanceRatio(const RayPair& pair, const Motion& motion) {
  const double kappa = std::exp(motion[2]);
  const Eigen::Vector2d current = kappa * pair.current, target = kappa * pair.target;
  const double alpha_c = -std::atan(current.x()) - motion[0], alpha_t = -std::atan(target.x()) - motion[1];
  const double elevation_c = current.y() / std::hypot(1.0, current.x());
  const double elevation_t = target.y() / std::hypot(1.0, target.x());
  double sum = 0, weights = 0;
  const double beside = std::sin(alpha_c) * std::sin(alpha_c);
  if (beside > 1e-6) {
    sum += beside * std::sin(alpha_t - alpha_c) / std::sin(alpha_c);
    weights += beside;
  }
  if (std::abs(elevation_c) > 1e-3 && elevation_t / elevation_c > 0) {
    const double ratio = elevation_t / elevation_c;  // of the distances, current to target
    const double ahead = elevation_c * elevation_c / (1 + ratio * ratio);
    sum += ahead * (ratio * std::cos(alpha_c) - std::cos(alpha_t));
    weights += ahead;
  }
  return weights > 0 ? std::pair(sum / weights, std::sqrt(weights)) : std::pair(0.0, 0.0);
}

double WeightedMedian(std::vector<std::pair<double, double>> values) {
  std::sort(values.begin(), values.end());
  double total = 0, sum = 0;
  for (const auto& [value, weight] : values) total += weight;
  for (const auto& [value, weight] : values) {
    sum += weight;
    if (sum >= 0.5 * total) return value;
  }
  return 0;
}

double SpreadPx(const std::vector<Eigen::Vector2d>& rays, double focal_px) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& ray : rays) mean += ray / static_cast<double>(rays.size());
  double squares = 0;
  for (const Eigen::Vector2d& ray : rays) squares += (ray - mean).squaredNorm();
  return focal_px * std::sqrt(squares / static_cast<double>(rays.size()));
}

}  // namespace

OptionTable DescribeOptions(PlanarEpipolesOptions* o) {
  return {
      {"noise_px", &o->noise_px, "standard deviation of a matched pixel", 0.01, 10},
      {"focal_ratio", &o->focal_ratio, "assumed focal length over the true one, as far as is known", 0.2, 5},
      {"focal_error_ratio", &o->focal_error_ratio, "standard deviation of that ratio", 0.001, 0.5},
      {"min_num_inliers", &o->min_num_inliers, "fewest matches that agree on one motion", 4},
      {"min_inlier_ratio", &o->min_inlier_ratio, "least share of the matches that agree on one motion", 0, 1},
      {"min_spread_px", &o->min_spread_px, "least standard deviation of these matches in each image, pixels",
       0, 10000},
      {"num_samples", &o->num_samples, "pairs of matches that are tried", 1, 100000},
      {"seed", &o->seed, "seed of these samples"},
  };
}

Result<PlanarEpipoles> EstimatePlanarEpipoles(const std::vector<RayPair>& pairs, double focal_px,
                                              const PlanarEpipolesOptions& options,
                                              const PlanarEpipoles* previous) {
  PlanarEpipolesOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (!(focal_px > 0) || !std::isfinite(focal_px)) {
    return MakeError(ErrorCode::kInvalidArgument, "a focal length of {:g} pixels: must be positive",
                     focal_px);
  }
  const Estimator estimator(pairs, focal_px, options);
  const auto least = static_cast<size_t>(options.min_num_inliers);
  if (estimator.num_pairs() < least) {
    return MakeError(ErrorCode::kNoData, "{} matches, at least {} are needed", estimator.num_pairs(), least);
  }
  Motion motion = estimator.Best(previous);

  PlanarEpipoles result;
  result.is_inlier.assign(pairs.size(), 0);
  std::vector<Eigen::Vector2d> current, target;
  std::vector<std::pair<double, double>> ratios;
  const Constraint constraint(motion);
  for (size_t i = 0; i < estimator.num_pairs(); ++i) {
    const RayPair& pair = estimator.pairs()[i];
    if (constraint.Evaluate(pair).SquaredError() > estimator.MaxSquaredError()) continue;
    result.is_inlier[estimator.index()[i]] = 1;
    ++result.num_inliers;
    current.push_back(pair.current);
    target.push_back(pair.target);
    ratios.push_back(DistanceRatio(pair, motion));
  }
  const double least_share = options.min_inlier_ratio * static_cast<double>(estimator.num_pairs());
  if (result.num_inliers < options.min_num_inliers || result.num_inliers < least_share) {
    return MakeError(ErrorCode::kNoData, "{} of {} matches agree on one motion, at least {} are needed",
                     result.num_inliers, estimator.num_pairs(),
                     std::max<int>(options.min_num_inliers, static_cast<int>(std::ceil(least_share))));
  }
  const double spread = std::min(SpreadPx(current, focal_px), SpreadPx(target, focal_px));
  if (spread < options.min_spread_px) {
    return MakeError(ErrorCode::kNoData, "the matches lie within {:.1f} pixels, at least {:g} are needed",
                     spread, options.min_spread_px);
  }
  const double ratio = WeightedMedian(ratios);
  if (ratio < 0) motion.head<2>().array() += std::numbers::pi;  // the other end is ahead
  result.psi_rad = WrapAngle(motion[0]);
  result.phi_rad = WrapAngle(motion[1] - std::numbers::pi);
  result.turn_rad = WrapAngle(motion[1] - motion[0]);
  result.focal_ratio = std::exp(motion[2]);
  result.focal_error_ratio = std::min(estimator.FocalError(motion), options.focal_error_ratio);
  result.distance_ratio = std::abs(ratio);
  return result;
}

}  // namespace cairn
