#include "core/promise/pose_information.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Nearer than this a landmark has no bearing, metres.
constexpr double kMinDistanceM = 1e-6;
constexpr double kRoughSigmaRatio = 0.5;
constexpr double kRoughSigmaDeg = 30;

}  // namespace

std::optional<Matrix26d> InformationRoot(const FeatureClass& feature_class, const Pose& cam_from_world,
                                         double keypoint_sigma_rad, double probability) {
  const Eigen::Vector3d point = cam_from_world * feature_class.position;
  const double distance = point.norm();
  if (distance < kMinDistanceM) return std::nullopt;
  const Matrix23d basis = TangentBasis(point / distance).transpose() / distance;
  Matrix26d jacobian;
  jacobian << -basis * CrossMatrix(point), basis;
  const Matrix23d basis_in_world = basis * cam_from_world.rotation.toRotationMatrix();
  const Eigen::Matrix2d noise = keypoint_sigma_rad * keypoint_sigma_rad * Eigen::Matrix2d::Identity() +
                                basis_in_world * feature_class.covariance * basis_in_world.transpose();
  // noise = L L', and the root is sqrt(p) L^-1 J: two rows, by hand because it is what costs time.
  const double l00 = std::sqrt(noise(0, 0));
  const double l10 = noise(1, 0) / l00;
  const double l11 = std::sqrt(noise(1, 1) - l10 * l10);
  Matrix26d root;
  root.row(0) = std::sqrt(probability) / l00 * jacobian.row(0);
  root.row(1) = std::sqrt(probability) / l11 * (jacobian.row(1) - l10 / l00 * jacobian.row(0));
  return root;
}

PoseInformation::PoseInformation(size_t num_views, double rough_sigma_m, double rough_sigma_deg) {
  Vector6d rough_sigma;
  rough_sigma << Eigen::Vector3d::Constant(RadFromDeg(rough_sigma_deg)),
      Eigen::Vector3d::Constant(rough_sigma_m);
  const Vector6d variance = rough_sigma.cwiseAbs2();
  views_.assign(num_views, {variance.cwiseInverse().asDiagonal(), variance.asDiagonal()});
}

PoseInformation PoseInformation::Rough(size_t num_views, double depth) {
  return {num_views, kRoughSigmaRatio * depth, kRoughSigmaDeg};
}

double PoseInformation::PlaceVariance(size_t view) const {
  return views_[view].covariance.bottomRightCorner<3, 3>().trace();
}

double PoseInformation::DeterminantGain(const std::vector<SightInformation>& sights) const {
  double gain = 0;
  for (const SightInformation& sight : sights) {
    // det(A + R' R) = det(A) det(1 + R A^-1 R')
    const Eigen::Matrix2d factor =
        Eigen::Matrix2d::Identity() + sight.root * views_[sight.view].covariance * sight.root.transpose();
    gain += std::log(std::max(1.0, factor.determinant()));
  }
  return gain;
}

double PoseInformation::PlaceGain(const SightInformation& sight) const {
  // (A + R' R)^-1 = C - C R' (1 + R C R')^-1 R C, C = A^-1
  const Matrix6d& covariance = views_[sight.view].covariance;
  const Eigen::Matrix<double, 6, 2> product = covariance * sight.root.transpose();
  const Eigen::Matrix2d factor = Eigen::Matrix2d::Identity() + sight.root * product;
  const Eigen::Matrix<double, 3, 2> of_place = product.bottomRows<3>();
  const double fall = (of_place * factor.inverse() * of_place.transpose()).trace();
  const double trace = PlaceVariance(sight.view);
  return fall <= 0 ? 0 : -std::log1p(-std::min(fall / trace, 1 - 1e-12));
}

void PoseInformation::Add(const std::vector<SightInformation>& sights) {
  for (const SightInformation& sight : sights) {
    View& view = views_[sight.view];
    view.information += sight.root.transpose() * sight.root;
    view.covariance = view.information.inverse();
  }
}

}  // namespace cairn
