#include "stages/reconstruct/verdict/seen_from_above.h"

#include <cmath>

#include <Eigen/Eigenvalues>

namespace cairn::reconstruct {
namespace {

// The plane that the centres are nearest to is taken where its second extent is at least this much of the
// first, and that from above less than this much of it.
constexpr double kMinSecondExtent = 0.1, kHidden = 0.5;

// Makes the largest component of a direction positive, so that it is always the same of the two.
Eigen::Vector3d OneWay(const Eigen::Vector3d& direction) {
  Eigen::Index largest = 0;
  direction.cwiseAbs().maxCoeff(&largest);
  return direction[largest] < 0 ? Eigen::Vector3d(-direction) : direction;
}

}  // namespace

std::vector<Eigen::Vector2d> SeenFromAbove(const std::vector<Eigen::Vector3d>& centres) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& centre : centres) mean += centre / static_cast<double>(centres.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& centre : centres)
    covariance += (centre - mean) * (centre - mean).transpose() / static_cast<double>(centres.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> in_space(covariance);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> from_above(covariance.topLeftCorner<2, 2>());
  const auto extent = [](double variance) { return std::sqrt(std::max(variance, 0.0)); };
  const double first = extent(in_space.eigenvalues()[2]), second = extent(in_space.eigenvalues()[1]);
  const bool is_hidden =
      second >= kMinSecondExtent * first && extent(from_above.eigenvalues()[0]) < kHidden * second;
  Eigen::Matrix<double, 2, 3> shown = Eigen::Matrix<double, 2, 3>::Identity();
  if (is_hidden) {
    shown.row(0) = OneWay(in_space.eigenvectors().col(2));
    shown.row(1) = OneWay(in_space.eigenvectors().col(1));
  }
  std::vector<Eigen::Vector2d> places;
  for (const Eigen::Vector3d& centre : centres) places.emplace_back(shown * centre);
  return places;
}

}  // namespace cairn::reconstruct
