#include "stages/group_classes/adjust/keypoint_noise.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>

#include "core/base/quantiles.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::group_classes {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kMedianChiSquare = 1.3863;  // of 2 degrees of freedom: 2 ln 2
constexpr double kMaxWhitened = 4;           // residuals beyond are outliers
constexpr int kMinNumOfHalf = 20;
constexpr size_t kMinNumPairs = 8;

// Variance of a coordinate by the squared scale: least squares through class medians, neither part negative.
void FitSigmas(const std::vector<double>& squares, const std::vector<double>& scales, KeypointNoise* noise) {
  constexpr size_t kNumClasses = 8, kMinNumOfClass = 30;
  const size_t num_classes = std::clamp<size_t>(squares.size() / kMinNumOfClass, 1, kNumClasses);
  std::vector<int> order(squares.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return scales[a] < scales[b]; });
  double n = 0, sum_x = 0, sum_y = 0, sum_xx = 0, sum_xy = 0;
  for (size_t c = 0; c < num_classes; ++c) {
    std::vector<double> of_class;
    double x = 0;
    for (size_t i = c * order.size() / num_classes; i < (c + 1) * order.size() / num_classes; ++i) {
      of_class.push_back(squares[order[i]]);
      x += scales[order[i]] * scales[order[i]];
    }
    x /= static_cast<double>(of_class.size());
    const double y = UpperMedian(of_class) / kMedianChiSquare;
    n += 1, sum_x += x, sum_y += y, sum_xx += x * x, sum_xy += x * y;
  }
  const double spread = n * sum_xx - sum_x * sum_x;
  double slope = spread > 1e-9 * sum_xx ? (n * sum_xy - sum_x * sum_y) / spread : 0;
  double constant = (sum_y - slope * sum_x) / n;
  if (slope < 0) slope = 0, constant = sum_y / n;
  if (constant < 0) constant = 0, slope = sum_xy / sum_xx;
  noise->sigma_px = std::sqrt(std::max(1e-4, constant));
  noise->sigma_per_scale = std::sqrt(slope);
}

// Normal equations of one image's pose from a part of its keypoints.
struct PartialPose {
  Matrix6d normal = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  int num_keypoints = 0;

  void Add(const BundleProblem& problem, const BundleProblem::Observation& o, const Eigen::Vector2d& residual,
           double sigma_px) {
    const Eigen::Vector3d x = problem.images[o.image_idx].cam_from_world * problem.points[o.point_idx];
    const Eigen::Matrix<double, 2, 3> from_x = o.ray.ResidualByPoint(x);
    Eigen::Matrix<double, 2, 6> jacobian;
    jacobian << -from_x * CrossMatrix(x), from_x;
    normal += jacobian.transpose() * jacobian / (sigma_px * sigma_px);
    gradient += jacobian.transpose() * residual / (sigma_px * sigma_px);
    ++num_keypoints;
  }
};

// Squared difference of two estimates of a pose by its covariance, over 6; nothing where one is undetermined.
std::optional<double> Disagreement(const PartialPose& a, const PartialPose& b) {
  const Eigen::LDLT<Matrix6d> of_a(a.normal), of_b(b.normal);
  for (const auto* factors : {&of_a, &of_b}) {
    if (factors->info() != Eigen::Success || !(factors->vectorD().minCoeff() > 0)) return std::nullopt;
  }
  const Vector6d difference = of_a.solve(a.gradient) - of_b.solve(b.gradient);
  const Matrix6d covariance = of_a.solve(Matrix6d::Identity()) + of_b.solve(Matrix6d::Identity());
  const double squared = difference.dot(covariance.ldlt().solve(difference)) / 6;
  if (!std::isfinite(squared)) return std::nullopt;
  return squared;
}

}  // namespace

KeypointNoise MeasureKeypointNoise(const BundleProblem& problem, const std::vector<double>& scales) {
  KeypointNoise noise;
  if (problem.observations.empty()) return noise;
  std::vector<Eigen::Vector2d> residuals;
  std::vector<double> squares;
  for (const BundleProblem::Observation& observation : problem.observations) {
    residuals.push_back(ResidualOf(problem, observation));
    squares.push_back(residuals.back().squaredNorm());
  }
  FitSigmas(squares, scales, &noise);

  // Halves: left, right, upper, lower.
  std::vector<std::array<PartialPose, 4>> halves(problem.images.size());
  std::vector<Eigen::Vector2d> middle(problem.images.size(), Eigen::Vector2d::Zero());
  std::vector<double> count(problem.images.size(), 0);
  for (const BundleProblem::Observation& o : problem.observations) {
    middle[o.image_idx] += o.pixel;
    ++count[o.image_idx];
  }
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleProblem::Observation& o = problem.observations[i];
    const double sigma_px = noise.SigmaPx(scales[i]);
    if (squares[i] > kMaxWhitened * kMaxWhitened * sigma_px * sigma_px) continue;
    const Eigen::Vector2d from_middle = o.pixel - middle[o.image_idx] / count[o.image_idx];
    halves[o.image_idx][from_middle.x() < 0 ? 0 : 1].Add(problem, o, residuals[i], sigma_px);
    halves[o.image_idx][from_middle.y() < 0 ? 2 : 3].Add(problem, o, residuals[i], sigma_px);
  }
  double excess = 0, num_keypoints = 0;
  size_t num_pairs = 0;
  for (const std::array<PartialPose, 4>& of_image : halves) {
    for (int first = 0; first < 4; first += 2) {
      const PartialPose &a = of_image[first], &b = of_image[first + 1];
      if (std::min(a.num_keypoints, b.num_keypoints) < kMinNumOfHalf) continue;
      const std::optional<double> disagreement = Disagreement(a, b);
      if (!disagreement) continue;
      excess += *disagreement - 1;
      num_keypoints += 0.5 * (a.num_keypoints + b.num_keypoints);
      ++num_pairs;
    }
  }
  if (num_pairs >= kMinNumPairs) noise.correlation = std::clamp(excess / num_keypoints, 0.0, 1.0);
  return noise;
}

}  // namespace cairn::group_classes
