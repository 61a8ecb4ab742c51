#include "stages/reconstruct/inertial/imu_turn.h"

#include <cmath>

#include <Eigen/Eigenvalues>

#include "core/base/quantiles.h"
#include "core/geometry/rotations.h"

namespace cairn::reconstruct {
namespace {

constexpr int kNumRounds = 20;
// Of a vector of three equal normal values: the median of its length over their standard deviation.
constexpr double kMedianLengthOf3 = 1.538;
constexpr double kSigmasOff = 3;
constexpr double kLeastSpreadRad = 1e-6;

}  // namespace

ImuTurn FitImuTurn(const std::vector<TurnPair>& pairs, const std::optional<Eigen::Quaterniond>& stated) {
  ImuTurn found;
  if (stated) found.cam_from_imu = *stated;
  std::vector<double> weights(pairs.size(), 1);
  for (int round = 0; round < kNumRounds; ++round) {
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (size_t k = 0; k < pairs.size(); ++k) {
      moments +=
          weights[k] * pairs[k].of_camera * (pairs[k].of_imu - found.gyro_bias * pairs[k].dt_s).transpose();
    }
    if (!stated) found.cam_from_imu = Eigen::Quaterniond(NearestRotation(moments));
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double sum_squares = 0;
    for (size_t k = 0; k < pairs.size(); ++k) {
      sum += weights[k] * pairs[k].dt_s *
             (pairs[k].of_imu - found.cam_from_imu.conjugate() * pairs[k].of_camera);
      sum_squares += weights[k] * pairs[k].dt_s * pairs[k].dt_s;
    }
    found.gyro_bias = sum / sum_squares;
    std::vector<double> errors;
    for (const TurnPair& pair : pairs) {
      const Eigen::Vector3d imu = pair.of_imu - found.gyro_bias * pair.dt_s;
      errors.push_back((pair.of_camera - found.cam_from_imu * imu).norm());
    }
    found.spread_rad = std::max(kLeastSpreadRad, Median(errors) / kMedianLengthOf3);
    for (size_t k = 0; k < pairs.size(); ++k) {
      const double sigmas = errors[k] / (kSigmasOff * found.spread_rad);
      weights[k] = 1 / (1 + sigmas * sigmas);
    }
  }
  // Turns say nothing of a rotation about their own axis.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double left = 0, turned = 0;
  for (size_t k = 0; k < pairs.size(); ++k) {
    const Eigen::Vector3d& turn = pairs[k].of_camera;
    const Eigen::Vector3d imu = pairs[k].of_imu - found.gyro_bias * pairs[k].dt_s;
    information += weights[k] * (turn.squaredNorm() * Eigen::Matrix3d::Identity() - turn * turn.transpose());
    left += weights[k] * (turn - found.cam_from_imu * imu).squaredNorm();
    turned += weights[k] * turn.squaredNorm();
  }
  found.left_ratio = turned > 0 ? left / turned : 1;
  if (stated) return found;
  const double weakest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()(0);
  found.sigma_rad = weakest > 0 ? found.spread_rad / std::sqrt(weakest) : INFINITY;
  return found;
}

}  // namespace cairn::reconstruct
