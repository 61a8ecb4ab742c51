#include "core/promise/pose_information.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Matrix62d = Eigen::Matrix<double, 6, 2>;
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
  covariances_.assign(num_views, rough_sigma.cwiseAbs2().asDiagonal());
}

PoseInformation PoseInformation::Rough(size_t num_views, double depth) {
  return {num_views, kRoughSigmaRatio * depth, kRoughSigmaDeg};
}

double PoseInformation::PlaceVariance(size_t view) const {
  return covariances_[view].bottomRightCorner<3, 3>().trace();
}

double PoseInformation::DeterminantGain(const std::vector<SightInformation>& sights) const {
  double gain = 0;
  for (const SightInformation& sight : sights) {
    // det(A + R' R) = det(A) det(1 + R A^-1 R')
    const Eigen::Matrix2d factor =
        Eigen::Matrix2d::Identity() + sight.root * covariances_[sight.view] * sight.root.transpose();
    gain += std::log(std::max(1.0, factor.determinant()));
  }
  return gain;
}

// (A + R' R)^-1 = C - C R' F^-1 R C,   F = 1 + R C R',   C = A^-1 [Woodbury].

double PoseInformation::PlaceRatio(size_t view, const Matrix26d& root) const {
  // By columns: landmarks are put into their order in the time that this takes.
  const Matrix6d& c = covariances_[view];
  const auto product_with = [&](int row) -> Vector6d {
    return c.col(0) * root(row, 0) + c.col(1) * root(row, 1) + c.col(2) * root(row, 2) +
           c.col(3) * root(row, 3) + c.col(4) * root(row, 4) + c.col(5) * root(row, 5);
  };
  const Vector6d a = product_with(0), b = product_with(1);
  const Vector6d row_a = root.row(0), row_b = root.row(1);
  const double f00 = 1 + row_a.dot(a), f01 = row_a.dot(b), f11 = 1 + row_b.dot(b);
  const double s00 = a.tail<3>().squaredNorm(), s01 = a.tail<3>().dot(b.tail<3>()),
               s11 = b.tail<3>().squaredNorm();
  const double fall = (f11 * s00 - 2 * f01 * s01 + f00 * s11) / (f00 * f11 - f01 * f01);
  return 1 - std::clamp(fall / PlaceVariance(view), 0.0, 1 - 1e-12);
}

void PoseInformation::Add(const std::vector<SightInformation>& sights) {
  for (const SightInformation& sight : sights) {
    Matrix6d& covariance = covariances_[sight.view];
    const Matrix62d product = covariance * sight.root.transpose();
    const Eigen::Matrix2d factor = Eigen::Matrix2d::Identity() + sight.root * product;
    covariance -= product * factor.inverse() * product.transpose();
  }
}

}  // namespace cairn
