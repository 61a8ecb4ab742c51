#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/random.h"
#include "core/geometry/rotations.h"
#include "core/geometry/similarity.h"
#include "stages/reconstruct/inertial/inertial_alignment.h"
#include "stages/reconstruct/inertial/inertial_start.h"

namespace cairn::reconstruct {

// Motions with an IMU, for tests: where the camera is at a time, what a consumer's IMU on it measures, and
// what a mapper makes of its images.

using Motion = std::function<Pose(double time_s)>;  // world_from_cam, z up, metres

// A sum of waves of random phases: smooth, and never the same again.
struct Waves {
  struct Wave {
    double amplitude, hz, phase;
  };
  std::vector<Wave> waves;
  double operator()(double t) const {
    double sum = 0;
    for (const Wave& w : waves) sum += w.amplitude * std::sin(2 * std::numbers::pi * w.hz * t + w.phase);
    return sum;
  }
};
inline Waves RandomWaves(const std::vector<std::pair<double, double>>& amplitude_and_hz, Random& random) {
  Waves waves;
  for (const auto& [amplitude, hz] : amplitude_and_hz) {
    waves.waves.push_back({amplitude * random.Uniform(0.7, 1.3), hz * random.Uniform(0.8, 1.25),
                           random.Uniform(0, 2 * std::numbers::pi)});
  }
  return waves;
}

// Of a camera that looks along +x: its x is -y, its y is -z.
inline Eigen::Quaterniond LooksAhead() { return {0.5, -0.5, 0.5, -0.5}; }

inline Eigen::Quaterniond YawPitchRoll(double yaw, double pitch, double roll) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

// Someone who walks about a room at about 0.8 m/s with a camera in the hand: two steps a second, which go up
// and down by 2 cm and to the sides by 2.5 cm, and a hand that looks about.
inline Motion Handheld(uint64_t seed) {
  Random random(seed);
  const Waves x = RandomWaves({{3, 0.03}, {1, 0.08}, {0.01, 1.9}}, random);
  const Waves y = RandomWaves({{2.5, 0.035}, {0.8, 0.09}, {0.025, 0.95}}, random);
  const Waves z = RandomWaves({{0.1, 0.1}, {0.03, 0.4}, {0.02, 1.9}}, random);
  const Waves yaw = RandomWaves({{1.5, 0.04}, {0.3, 0.2}, {0.05, 0.6}, {0.01, 1.9}}, random);
  const Waves pitch = RandomWaves({{0.15, 0.15}, {0.05, 0.5}, {0.01, 1.9}}, random);
  const Waves roll = RandomWaves({{0.08, 0.12}, {0.04, 0.45}, {0.01, 0.95}}, random);
  return [=](double t) -> Pose {
    return {YawPitchRoll(yaw(t), pitch(t), roll(t)) * LooksAhead(), {x(t), y(t), 1.5 + z(t)}};
  };
}

// A robot on wheels, 0.5 m/s on the mean, that speeds up, brakes and turns, on a floor that is not quite
// flat.
inline Motion Wheeled(uint64_t seed) {
  Random random(seed);
  const Waves x = RandomWaves({{4, 0.015}, {0.6, 0.06}, {0.15, 0.15}}, random);
  const Waves y = RandomWaves({{3, 0.02}, {0.6, 0.05}, {0.1, 0.13}}, random);
  const Waves tilt = RandomWaves({{0.003, 0.3}, {0.002, 1.5}}, random);
  return [=](double t) -> Pose {
    constexpr double h = 1e-3;
    const double heading = std::atan2(y(t + h) - y(t - h), x(t + h) - x(t - h));
    return {YawPitchRoll(heading, tilt(t), tilt(t + 7)) * LooksAhead(), {x(t), y(t), 0.5}};
  };
}

// Straight ahead at one speed: no accelerometer can tell its length.
inline Motion Steady() {
  return [](double t) -> Pose {
    return {YawPitchRoll(0.3 * std::sin(t), 0.2 * std::sin(0.7 * t), 0.1 * std::sin(1.3 * t)) * LooksAhead(),
            {0.5 * t, 0, 0.5}};
  };
}

// A consumer's part.
struct SimulatedImu {
  double rate_hz = 200;
  ImuNoise noise;                                     // rad/s, m/s^2 a root of Hz
  Eigen::Vector3d gyro_bias = {0.01, -0.007, 0.008};  // rad/s
  Eigen::Vector3d accel_bias = {0.05, 0.03, -0.04};   // m/s^2
  Pose cam_from_imu = {Eigen::Quaterniond(0.7, 0.1, -0.7, 0.1).normalized(), {0.03, -0.02, 0.01}};
  double time_offset_s = 0;  // of the images' clock: its stamps are so much too early
};

inline SimulatedImu ImuOfSeed(uint64_t seed) {
  Random random(MixSeed(seed, 17));
  SimulatedImu imu;
  for (int i = 0; i < 3; ++i) {
    imu.gyro_bias[i] = random.Normal(0, 0.01);
    imu.accel_bias[i] = random.Normal(0, 0.05);
  }
  return imu;
}

// What it says from 0 to `duration_s`.
inline ImuRecording RecordImu(const Motion& motion, const SimulatedImu& imu, double duration_s,
                              uint64_t seed) {
  Random random(MixSeed(seed, 23));
  const auto at = [&](double t) { return motion(t) * imu.cam_from_imu; };  // world_from_imu
  const double root = std::sqrt(imu.rate_hz);
  const auto normal = [&](double sigma) {
    const double x = random.Normal(0, sigma), y = random.Normal(0, sigma);
    return Eigen::Vector3d(x, y, random.Normal(0, sigma));
  };
  ImuRecording recording;
  recording.typical_step_s = 1 / imu.rate_hz;
  recording.cam_from_imu = imu.cam_from_imu;
  for (int i = 0; i <= duration_s * imu.rate_hz; ++i) {
    const double t = i / imu.rate_hz;
    constexpr double h = 1e-3;
    const Pose before = at(t - h), now = at(t), after = at(t + h);
    const Eigen::Vector3d acceleration =
        (after.translation - 2 * now.translation + before.translation) / (h * h);
    const Eigen::Vector3d force =
        now.rotation.conjugate() * Eigen::Vector3d(acceleration + kGravityMS2 * Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d turn =
        VectorFromQuaternion(Eigen::Quaterniond(before.rotation.conjugate() * after.rotation)) / (2 * h);
    recording.samples.push_back({std::llround(t * 1e9),
                                 turn + imu.gyro_bias + normal(imu.noise.gyro_rad_s_rthz * root),
                                 force + imu.accel_bias + normal(imu.noise.accel_m_s2_rthz * root)});
  }
  return recording;
}

// What a mapper makes of images: some frame, some scale, and errors: of each image, and a bend that grows.
struct SimulatedModel {
  double model_per_metre = 0.37;
  double place_sigma_m = 0.003, turn_sigma_deg = 0.05;
  double bend_sigma_m = 0.001, bend_sigma_deg = 0.01;  // from image to image
  double step_s = 0.4;                                 // between images
};
inline Similarity ModelFromWorld(double model_per_metre) {
  return {model_per_metre, Eigen::Quaterniond(0.4, 0.5, -0.6, 0.2).normalized(), {3, -1, 7}};
}
// Between the world's up and what is found of it.
inline double UpErrorDeg(const InertialAlignment& alignment) {
  const Eigen::Vector3d up = ModelFromWorld(1).rotation * Eigen::Vector3d::UnitZ();
  return DegFromRad(std::acos(std::min(1.0, up.dot(alignment.up))));
}
// Makes a model image by image; times are those of the images' clock.
class ModelMaker {
 public:
  ModelMaker(Motion motion, const SimulatedModel& model, double time_offset_s, uint64_t seed)
      : motion_(std::move(motion)),
        model_(model),
        time_offset_s_(time_offset_s),
        random_(MixSeed(seed, 31)),
        model_from_world_(ModelFromWorld(model.model_per_metre)) {}
  Random& random() { return random_; }
  void Add(double time_s) {
    bent_m_ += Normal(model_.bend_sigma_m);
    bent_rad_ += Normal(RadFromDeg(model_.bend_sigma_deg));
    Pose world_from_cam = motion_(time_s + time_offset_s_);
    world_from_cam.translation += bent_m_ + Normal(model_.place_sigma_m);
    world_from_cam.rotation = QuaternionFromVector<double>(bent_rad_) * world_from_cam.rotation *
                              QuaternionFromVector<double>(Normal(RadFromDeg(model_.turn_sigma_deg)));
    const auto time_ns = std::llround(time_s * 1e9);
    images_.push_back({fmt::format("{:010}.{:09}.jpg", time_ns / 1'000'000'000, time_ns % 1'000'000'000),
                       time_ns, TransformPose(model_from_world_, world_from_cam.Inverse())});
  }
  std::vector<TimedImage> Finish() { return std::move(images_); }

 private:
  Eigen::Vector3d Normal(double sigma) {
    const double x = random_.Normal(0, sigma), y = random_.Normal(0, sigma);
    return {x, y, random_.Normal(0, sigma)};
  }
  Motion motion_;
  SimulatedModel model_;
  double time_offset_s_;
  Random random_;
  Similarity model_from_world_;
  std::vector<TimedImage> images_;
  Eigen::Vector3d bent_m_ = Eigen::Vector3d::Zero(), bent_rad_ = Eigen::Vector3d::Zero();
};
inline std::vector<TimedImage> ModelOfMotion(const Motion& motion, const SimulatedModel& model,
                                             double duration_s, double time_offset_s, uint64_t seed) {
  ModelMaker maker(motion, model, time_offset_s, seed);
  for (double t = 0.1; t < duration_s - 0.1; t += model.step_s * maker.random().Uniform(0.5, 1.5))
    maker.Add(t);
  return maker.Finish();
}

}  // namespace cairn::reconstruct
