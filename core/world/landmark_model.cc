#include "core/world/landmark_model.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace cairn {
namespace {

// Fewer places than this, or places within this distance of a line, have no slope.
constexpr int kMinNumForSlope = 6;
constexpr double kMinSpreadM = 0.05;
// An error of one octave of scale counts as this many pixels when shapes are compared.
constexpr double kPxPerOctave = 20;

Eigen::Vector2d MiddleOf(const std::vector<Sight>& sights) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Sight& sight : sights) sum += sight.place;
  return sum / static_cast<double>(sights.size());
}

// Rows: the trend's basis at every place; one column where the places determine no slope.
Eigen::MatrixXd TrendBasis(const std::vector<Sight>& sights, const Eigen::Vector2d& middle) {
  const auto n = static_cast<Eigen::Index>(sights.size());
  Eigen::MatrixXd basis = Eigen::MatrixXd::Ones(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) basis.row(i).tail<2>() = (sights[i].place - middle).transpose();
  const Eigen::Matrix2d moments =
      basis.rightCols<2>().transpose() * basis.rightCols<2>() / static_cast<double>(n);
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(moments).eigenvalues()[0];
  if (n < kMinNumForSlope || !(least > kMinSpreadM * kMinSpreadM)) basis.conservativeResize(n, 1);
  return basis;
}

Eigen::MatrixXd SquaredDistances(const std::vector<Sight>& sights) {
  const auto n = static_cast<Eigen::Index>(sights.size());
  Eigen::MatrixXd squared(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) squared(i, j) = (sights[i].place - sights[j].place).squaredNorm();
  return squared;
}

Eigen::MatrixX3d SeenOf(const std::vector<Sight>& sights) {
  Eigen::MatrixX3d seen(sights.size(), 3);
  for (size_t i = 0; i < sights.size(); ++i) seen.row(i) = sights[i].seen.transpose();
  return seen;
}

double InverseSquaredLength(const KernelShape& shape) {
  const double length = kKernelLengthsM[shape.length];
  return 1 / (length * length);
}

Eigen::LLT<Eigen::MatrixXd> FactorKernel(const Eigen::MatrixXd& squared_distances, const KernelShape& shape) {
  Eigen::MatrixXd kernel = (squared_distances.array() * (-0.5 * InverseSquaredLength(shape))).exp().matrix();
  kernel.diagonal().array() += kKernelNoises[shape.noise];
  return kernel.llt();
}

std::optional<Eigen::Matrix3Xd> LeftOutErrors(const Eigen::MatrixXd& squared_distances,
                                              const Eigen::MatrixXd& basis, const Eigen::MatrixX3d& seen,
                                              const KernelShape& shape) {
  const auto factor = FactorKernel(squared_distances, shape);
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::Index n = seen.rows();
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd inverse_basis = inverse * basis;
  // [Sala06 §VI-C: after Sim & Dudek] leave-one-out cross-validation, in closed form (landmark_model.h)
  const Eigen::MatrixXd q =
      inverse - inverse_basis * (basis.transpose() * inverse_basis).inverse() * inverse_basis.transpose();
  const Eigen::Matrix3Xd errors =
      ((-(q * seen)).array().colwise() / q.diagonal().array()).matrix().transpose();
  if (!errors.allFinite()) return std::nullopt;
  return errors;
}

bool AreFinite(const std::vector<Sight>& sights) {
  for (const Sight& sight : sights) {
    if (!sight.place.allFinite() || !sight.seen.allFinite()) return false;
  }
  return sights.size() >= kMinNumSights;
}

}  // namespace

std::optional<LandmarkModel> LandmarkModel::Make(const std::vector<Sight>& sights, const KernelShape& shape) {
  if (!AreFinite(sights)) return std::nullopt;
  LandmarkModel model;
  model.middle_ = MiddleOf(sights);
  model.inverse_squared_length_ = InverseSquaredLength(shape);
  const Eigen::MatrixXd basis = TrendBasis(sights, model.middle_);
  const Eigen::MatrixX3d seen = SeenOf(sights);
  const auto factor = FactorKernel(SquaredDistances(sights), shape);
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::MatrixXd inverse_basis = factor.solve(basis);
  const Eigen::MatrixXd trend =
      (basis.transpose() * inverse_basis).inverse() * (inverse_basis.transpose() * seen);
  model.trend_.setZero();
  model.trend_.leftCols(trend.rows()) = trend.transpose();
  model.weights_ = factor.solve(seen - basis * trend).transpose();
  if (!model.weights_.allFinite() || !model.trend_.allFinite()) return std::nullopt;
  for (const Sight& sight : sights) model.places_.push_back(sight.place);
  return model;
}

LandmarkModel::Prediction LandmarkModel::Predict(const Eigen::Vector2d& place) const {
  // [Sala06 §VI-C: after Sim & Dudek] f(x), by a trend and a Gaussian process instead of their interpolation
  const Eigen::Vector2d from_middle = place - middle_;
  Prediction prediction{trend_.col(0) + trend_.rightCols<2>() * from_middle, trend_.rightCols<2>()};
  for (size_t i = 0; i < places_.size(); ++i) {
    const Eigen::Vector2d away = place - places_[i];
    const double kernel = std::exp(-0.5 * inverse_squared_length_ * away.squaredNorm());
    const Eigen::Vector3d part = kernel * weights_.col(static_cast<Eigen::Index>(i));
    prediction.seen += part;
    prediction.gradient -= part * (inverse_squared_length_ * away).transpose();
  }
  return prediction;
}

std::optional<Eigen::Matrix3Xd> LandmarkModel::LeaveOneOutErrors(const std::vector<Sight>& sights,
                                                                 const KernelShape& shape) {
  if (!AreFinite(sights)) return std::nullopt;
  return LeftOutErrors(SquaredDistances(sights), TrendBasis(sights, MiddleOf(sights)), SeenOf(sights), shape);
}

std::optional<KernelChoice> ChooseKernel(const std::vector<Sight>& sights) {
  if (!AreFinite(sights)) return std::nullopt;
  const Eigen::MatrixXd squared_distances = SquaredDistances(sights);
  const Eigen::MatrixXd basis = TrendBasis(sights, MiddleOf(sights));
  const Eigen::MatrixX3d seen = SeenOf(sights);
  std::optional<KernelChoice> best;
  double least = 0;
  for (KernelShape shape; shape.length < kNumKernelLengths; ++shape.length) {
    for (shape.noise = 0; shape.noise < kNumKernelNoises; ++shape.noise) {
      const auto errors = LeftOutErrors(squared_distances, basis, seen, shape);
      if (!errors) continue;
      const Eigen::Vector3d sigma =
          (errors->rowwise().squaredNorm() / static_cast<double>(errors->cols())).cwiseSqrt();
      const double cost = sigma.head<2>().squaredNorm() + kPxPerOctave * kPxPerOctave * sigma.z() * sigma.z();
      if (best && !(cost < least)) continue;
      best = KernelChoice{shape, sigma};
      least = cost;
    }
  }
  return best;
}

}  // namespace cairn
