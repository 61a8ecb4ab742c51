#include "core/camera/distortion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace cairn {
namespace {

constexpr int kMaxIterations = 200;
constexpr double kTolerance = 1e-12;
constexpr int kMaxSubdivisions = 24;
// Places between the centre and a point at which the map with decentering is tested for folds.
constexpr int kNumFoldTests = 8;

template <size_t N>
double Evaluate(const std::array<double, N>& polynomial, double t) {
  double value = 0;
  for (size_t i = N; i-- > 0;) value = value * t + polynomial[i];
  return value;
}

template <size_t N>
double EvaluateDerivative(const std::array<double, N>& polynomial, double t) {
  double value = 0;
  for (size_t i = N; i-- > 1;) value = value * t + static_cast<double>(i) * polynomial[i];
  return value;
}

// Whether a polynomial in Bernstein form is positive on [0, 1]: it lies between its least and greatest
// coefficient, and halves of the interval are looked at until these decide.
template <size_t N>
bool BernsteinIsPositive(const std::array<double, N>& bernstein, int num_subdivisions) {
  if (!(bernstein.front() > 0) || !(bernstein.back() > 0)) return false;
  if (std::all_of(bernstein.begin(), bernstein.end(), [](double b) { return b > 0; })) return true;
  if (num_subdivisions == 0) return false;
  std::array<double, N> left, right, row = bernstein;  // de Casteljau's triangle
  for (size_t level = 0; level < N; ++level) {
    left[level] = row[0];
    right[N - 1 - level] = row[N - 1 - level];
    for (size_t i = 0; i + level + 1 < N; ++i) row[i] = 0.5 * (row[i] + row[i + 1]);
  }
  return BernsteinIsPositive(left, num_subdivisions - 1) && BernsteinIsPositive(right, num_subdivisions - 1);
}

// Whether a polynomial (lowest power first) is positive on [0, end].
template <size_t N>
bool IsPositiveTo(const std::array<double, N>& polynomial, double end) {
  std::array<double, N> scaled{};
  double power = 1, least = polynomial[0];
  for (size_t i = 0; i < N; ++i, power *= end) {
    scaled[i] = polynomial[i] * power;
    if (i > 0) least += std::min(0.0, scaled[i]);
  }
  if (least > 0) return true;
  std::array<double, N> bernstein{};
  for (size_t i = 0; i < N; ++i) {
    double ratio = 1;  // binomial(i, j) / binomial(N - 1, j)
    for (size_t j = 0; j <= i; ++j) {
      bernstein[i] += ratio * scaled[j];
      if (j < i) ratio *= static_cast<double>(i - j) / static_cast<double>(N - 1 - j);
    }
  }
  return BernsteinIsPositive(bernstein, kMaxSubdivisions);
}

}  // namespace

Distortion::Distortion(const DistortionCoefficients& coefficients, double max_radius)
    : c_(coefficients), max_radius_(max_radius) {
  is_radial_ = c_.p1 == 0 && c_.p2 == 0 && c_.sx == 0 && c_.sy == 0;
  const auto& n = c_.numerator;
  const auto& d = c_.denominator;
  is_polynomial_ = d[1] == 0 && d[2] == 0 && d[3] == 0;
  // d(r n(t) / d(t)) / dr = ((n + 2 t n') d - 2 t n d') / d^2
  for (size_t i = 0; i < n.size(); ++i) {
    for (size_t j = 0; j < d.size(); ++j) {
      slope_[i + j] += n[i] * d[j] * (1 + 2 * static_cast<double>(i) - 2 * static_cast<double>(j));
    }
  }
}

double Distortion::Radial(double t) const {
  return is_polynomial_ ? Evaluate(c_.numerator, t) : Evaluate(c_.numerator, t) / Evaluate(c_.denominator, t);
}

double Distortion::RadialDerivative(double t) const {
  if (is_polynomial_) return EvaluateDerivative(c_.numerator, t);
  const double d = Evaluate(c_.denominator, t);
  return (EvaluateDerivative(c_.numerator, t) * d -
          Evaluate(c_.numerator, t) * EvaluateDerivative(c_.denominator, t)) /
         (d * d);
}

Eigen::Vector2d Distortion::Map(const Eigen::Vector2d& a) const {
  const double t = a.squaredNorm(), xy = a.x() * a.y(), radial = Radial(t);
  return {radial * a.x() + 2 * c_.p1 * xy + c_.p2 * (t + 2 * a.x() * a.x()) + c_.sx * t,
          radial * a.y() + 2 * c_.p2 * xy + c_.p1 * (t + 2 * a.y() * a.y()) + c_.sy * t};
}

Eigen::Matrix2d Distortion::Jacobian(const Eigen::Vector2d& a) const {
  const double t = a.squaredNorm(), x = a.x(), y = a.y();
  Eigen::Matrix2d jacobian = 2 * RadialDerivative(t) * a * a.transpose();
  jacobian.diagonal().array() += Radial(t);
  jacobian(0, 0) += 2 * c_.p1 * y + 6 * c_.p2 * x + 2 * c_.sx * x;
  jacobian(0, 1) += 2 * c_.p1 * x + 2 * c_.p2 * y + 2 * c_.sx * y;
  jacobian(1, 0) += 2 * c_.p2 * y + 2 * c_.p1 * x + 2 * c_.sy * x;
  jacobian(1, 1) += 2 * c_.p2 * x + 6 * c_.p1 * y + 2 * c_.sy * y;
  return jacobian;
}

bool Distortion::IsMonotoneTo(double radius) const {
  if (!(radius <= max_radius_)) return false;
  const double t = radius * radius;
  return (is_polynomial_ || IsPositiveTo(c_.denominator, t)) && IsPositiveTo(slope_, t);
}

bool Distortion::IsBeforeFold(const Eigen::Vector2d& a) const {
  if (!IsMonotoneTo(a.norm())) return false;
  if (is_radial_) return true;
  for (int i = 1; i <= kNumFoldTests; ++i) {
    if (!(Jacobian(a * (static_cast<double>(i) / kNumFoldTests)).determinant() > 0)) return false;
  }
  return true;
}

std::optional<Eigen::Vector2d> Distortion::Apply(const Eigen::Vector2d& a) const {
  if (!IsBeforeFold(a)) return std::nullopt;
  return Map(a);
}

// The radius whose image is `distorted`; `nearest` is that radius or, where there is none, the last one found
// before the fold.
std::optional<double> Distortion::InvertRadius(double distorted, double* nearest) const {
  double low = 0, high = max_radius_;  // the image of `low` is less than `distorted` and before the fold
  double radius = std::min(distorted, 0.5 * high);
  *nearest = 0;
  for (int i = 0; i < kMaxIterations; ++i) {
    double next = high;
    if (!IsMonotoneTo(radius)) {
      high = radius;
    } else {
      const double t = radius * radius;
      const double error = radius * Radial(t) - distorted;
      const double newton = radius - error / (Radial(t) + 2 * t * RadialDerivative(t));
      if (std::abs(newton - radius) <= 1e-15 * (1 + radius) &&
          std::abs(error) <= kTolerance * (1 + distorted)) {
        *nearest = radius;
        return radius;
      }
      (error < 0 ? low : high) = radius;
      next = newton;
    }
    *nearest = low;
    radius = next > low && next < high ? next : 0.5 * (low + high);
    if (high - low <= 1e-16 * high) break;
  }
  const bool is_found = std::abs(low * Radial(low * low) - distorted) <= kTolerance * (1 + distorted);
  return is_found ? std::optional(low) : std::nullopt;
}

std::optional<Eigen::Vector2d> Distortion::Invert(const Eigen::Vector2d& distorted) const {
  const double length = distorted.norm();
  if (!std::isfinite(length)) return std::nullopt;
  if (length == 0) return Eigen::Vector2d::Zero();
  double nearest = 0;
  const std::optional<double> radius = InvertRadius(length, &nearest);
  if (is_radial_) {
    if (!radius) return std::nullopt;
    return Eigen::Vector2d(distorted * (*radius / length));
  }
  Eigen::Vector2d a = distorted * (nearest / length);
  while (!IsBeforeFold(a)) a *= 0.5;
  Eigen::Vector2d error = Map(a) - distorted;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d step = -(Jacobian(a).inverse() * error);
    bool is_better = false;
    for (double length_ratio = 1; length_ratio > 1e-6 && !is_better; length_ratio *= 0.5) {
      const Eigen::Vector2d trial = a + length_ratio * step;
      const Eigen::Vector2d trial_error = Map(trial) - distorted;
      is_better = trial_error.squaredNorm() < error.squaredNorm() && IsBeforeFold(trial);
      if (is_better) a = trial, error = trial_error;
    }
    if (!is_better) break;
  }
  if (!(error.norm() <= kTolerance * (1 + length))) return std::nullopt;
  return a;
}

}  // namespace cairn
