#include "stages/reconstruct/inertial/preintegration.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/rotations.h"
#include "core/geometry/vector_geometry.h"

namespace cairn::reconstruct {
namespace {

double SecondsOf(int64_t ns) { return 1e-9 * static_cast<double>(ns); }

// What the IMU says at a time between two samples.
ImuSample At(const ImuSample& before, const ImuSample& after, int64_t time_ns) {
  const double part = static_cast<double>(time_ns - before.time_ns) / (after.time_ns - before.time_ns);
  return {time_ns, before.gyro + part * (after.gyro - before.gyro),
          before.accel + part * (after.accel - before.accel)};
}

// J_r(v), to the first order: turns within a step are small [Forster17 eq. 8].
Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& v) {
  return Eigen::Matrix3d::Identity() - 0.5 * CrossMatrix(v);
}

// One step of the integration, with its derivatives and its noise [Forster17 App. A, B].
void Advance(const ImuSample& from, const ImuSample& to, const ImuNoise& noise, Preintegrated* motion) {
  const double dt = SecondsOf(to.time_ns - from.time_ns);
  const Eigen::Vector3d turn = (0.5 * (from.gyro + to.gyro) - motion->gyro_bias) * dt;
  const Eigen::Vector3d accel = 0.5 * (from.accel + to.accel) - motion->accel_bias;
  const Eigen::Matrix3d middle =
      (motion->dR * QuaternionFromVector<double>(0.5 * turn)).toRotationMatrix();  // halfway through the step
  const Eigen::Matrix3d turned = -middle * CrossMatrix(accel) * dt;

  Matrix9d transition = Matrix9d::Identity();
  transition.block<3, 3>(0, 0) = QuaternionFromVector<double>(-turn).toRotationMatrix();
  transition.block<3, 3>(3, 0) = turned;
  transition.block<3, 3>(6, 0) = 0.5 * dt * turned;
  transition.block<3, 3>(6, 3) = dt * Eigen::Matrix3d::Identity();
  motion->by_bias = transition * motion->by_bias;
  motion->by_bias.block<3, 3>(0, 0) -= RightJacobian(turn) * dt;
  // The turn halfway through has half of the step's.
  motion->by_bias.block<3, 3>(3, 0) -= 0.5 * dt * turned;
  motion->by_bias.block<3, 3>(6, 0) -= 0.25 * dt * dt * turned;
  motion->by_bias.block<3, 3>(3, 3) -= middle * dt;
  motion->by_bias.block<3, 3>(6, 3) -= 0.5 * dt * dt * middle;

  const double gyro = noise.gyro_rad_s_rthz * noise.gyro_rad_s_rthz;
  const double accelerometer = noise.accel_m_s2_rthz * noise.accel_m_s2_rthz;
  motion->covariance = transition * motion->covariance * transition.transpose();
  motion->covariance.diagonal().head<3>().array() += gyro * dt;
  motion->covariance.diagonal().segment<3>(3).array() += accelerometer * dt;
  motion->covariance.diagonal().tail<3>().array() += accelerometer * dt * dt * dt / 3;
  for (int i = 0; i < 3; ++i) {
    motion->covariance(3 + i, 6 + i) += accelerometer * dt * dt / 2;
    motion->covariance(6 + i, 3 + i) += accelerometer * dt * dt / 2;
  }

  const Eigen::Vector3d change = middle * accel * dt;
  motion->dp += motion->dv * dt + 0.5 * dt * change;
  motion->dv += change;
  motion->dR = (motion->dR * QuaternionFromVector(turn)).normalized();
  motion->dt_s += dt;
}

}  // namespace

std::optional<Preintegrated> Preintegrate(const std::vector<ImuSample>& samples, int64_t begin_ns,
                                          int64_t end_ns, const Eigen::Vector3d& gyro_bias,
                                          const Eigen::Vector3d& accel_bias, const ImuNoise& noise) {
  // The last sample that is not after the beginning.
  auto sample = std::upper_bound(samples.begin(), samples.end(), begin_ns,
                                 [](int64_t time_ns, const ImuSample& s) { return time_ns < s.time_ns; });
  if (sample == samples.begin()) return std::nullopt;
  --sample;
  Preintegrated motion;
  motion.gyro_bias = gyro_bias;
  motion.accel_bias = accel_bias;
  std::optional<ImuSample> at;
  while (!at || at->time_ns < end_ns) {
    const auto next = sample + 1;
    if (next == samples.end() || SecondsOf(next->time_ns - sample->time_ns) > kMaxImuStepS)
      return std::nullopt;
    if (!at) {
      at = At(*sample, *next, begin_ns);
      motion.gyro_begin = at->gyro - gyro_bias;
    }
    const ImuSample to = next->time_ns < end_ns ? *next : At(*sample, *next, end_ns);
    if (to.time_ns > at->time_ns) Advance(*at, to, noise, &motion);
    at = to;
    sample = next;
  }
  motion.gyro_end = at->gyro - gyro_bias;
  return motion;
}

}  // namespace cairn::reconstruct
