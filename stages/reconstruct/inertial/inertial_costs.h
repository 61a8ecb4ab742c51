#pragma once

#include <array>

#include <ceres/ceres.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/geometry/rotations.h"
#include "stages/reconstruct/inertial/inertial_alignment.h"
#include "stages/reconstruct/inertial/preintegration.h"

namespace cairn::reconstruct::inertial {

// What the most likely scale and vertical are found from (inertial_alignment.h).

// Blocks of unknowns.  Common: log of the scale over the start's, gravity's direction (2), the IMU's place in
// the camera (3), its turn from the start's (3), the clocks' difference from the start's, seconds.
inline constexpr int kCommon = 10;
enum CommonPart { kLogScale = 0, kDown = 1, kPlace = 3, kTurn = 6, kClock = 9 };
inline constexpr int kBias = 6;   // gyro's, accelerometer's
inline constexpr int kImage = 9;  // turn (camera's axes), shift (model's unit), speed (m/s)
enum ImagePart { kImageTurn = 0, kImageShift = 3, kImageSpeed = 6 };

// What stays the same for all steps.
struct Frame {
  double scale = 1;                                    // of the start
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // columns: two level ones, down
  Eigen::Quaterniond cam_from_imu = Eigen::Quaterniond::Identity();
};

// Between two images [Forster17 eq. 45], whitened.
struct StepCost {
  const Frame& frame;
  const TimedImage &from, &to;
  const Preintegrated& imu;
  Matrix9d whitening;  // L^-1 of the covariance L L^T

  template <typename T>
  struct State {
    Eigen::Quaternion<T> model_from_imu;
    Eigen::Matrix<T, 3, 1> place, speed;
  };

  // Where the IMU was at the image's stamp.
  template <typename T>
  State<T> StateOf(const TimedImage& image, const T* block, const T* common,
                   const Eigen::Vector3d& gyro) const {
    using V = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const V> turn(block + kImageTurn), shift(block + kImageShift),
        speed(block + kImageSpeed);
    const Eigen::Map<const V> place(common + kPlace), mounted(common + kTurn);
    const Eigen::Quaternion<T> model_from_cam =
        image.cam_from_model.rotation.conjugate().cast<T>() * QuaternionFromVector<T>(V(turn));
    const T scale = T(frame.scale) * ceres::exp(common[kLogScale]);
    State<T> state;
    state.speed = speed;
    state.place = scale * (image.cam_from_model.Center().cast<T>() + shift) + model_from_cam * V(place) -
                  common[kClock] * speed;
    state.model_from_imu = model_from_cam * frame.cam_from_imu.cast<T>() *
                           QuaternionFromVector<T>(V(mounted)) *
                           QuaternionFromVector<T>(V(-common[kClock] * gyro.cast<T>()));
    return state;
  }

  template <typename T>
  bool operator()(const T* block1, const T* block2, const T* bias, const T* common, T* residual) const {
    using V = Eigen::Matrix<T, 3, 1>;
    const State<T> a = StateOf(from, block1, common, imu.gyro_begin);
    const State<T> b = StateOf(to, block2, common, imu.gyro_end);
    Eigen::Matrix<T, 6, 1> change = Eigen::Map<const Eigen::Matrix<T, 6, 1>>(bias);
    change.template head<3>() -= imu.gyro_bias.cast<T>();
    change.template tail<3>() -= imu.accel_bias.cast<T>();
    const Eigen::Matrix<T, 9, 1> by_bias = imu.by_bias.cast<T>() * change;
    const T dt(imu.dt_s);
    const V gravity =
        T(kGravityMS2) * (frame.axes.cast<T>() * V(common[kDown], common[kDown + 1], T(1)).normalized());
    const Eigen::Quaternion<T> imu_from_model = a.model_from_imu.conjugate();
    Eigen::Matrix<T, 9, 1> r;
    const Eigen::Quaternion<T> said =
        imu.dR.cast<T>() * QuaternionFromVector<T>(V(by_bias.template head<3>()));
    r.template head<3>() =
        VectorFromQuaternion(Eigen::Quaternion<T>(said.conjugate() * imu_from_model * b.model_from_imu));
    r.template segment<3>(3) = imu_from_model * V(b.speed - a.speed - gravity * dt) - imu.dv.cast<T>() -
                               by_bias.template segment<3>(3);
    r.template tail<3>() =
        imu_from_model * V(b.place - a.place - a.speed * dt - gravity * (T(0.5) * dt * dt)) -
        imu.dp.cast<T>() - by_bias.template tail<3>();
    Eigen::Map<Eigen::Matrix<T, 9, 1>> out(residual);
    out = whitening.cast<T>() * r;
    return true;
  }
};

// Three values of an image's block over their standard deviation.
struct PartCost {
  int first;
  double sigma;
  template <typename T>
  bool operator()(const T* block, T* residual) const {
    for (int i = 0; i < 3; ++i) residual[i] = block[first + i] / T(sigma);
    return true;
  }
};

// Values over their standard deviations, about what they are taken for.
template <int kSize>
struct StatedCost {
  std::array<double, kSize> value, sigma;
  template <typename T>
  bool operator()(const T* block, T* residual) const {
    for (int i = 0; i < kSize; ++i) residual[i] = (block[i] - T(value[i])) / T(sigma[i]);
    return true;
  }
};

struct WalkCost {
  std::array<double, kBias> sigma;
  template <typename T>
  bool operator()(const T* before, const T* after, T* residual) const {
    for (int i = 0; i < kBias; ++i) residual[i] = (after[i] - before[i]) / T(sigma[i]);
    return true;
  }
};

}  // namespace cairn::reconstruct::inertial
