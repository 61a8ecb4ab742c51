#include "stages/reconstruct/globally/adjust_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <vector>

#include <spdlog/spdlog.h>

#include "core/base/parallel.h"
#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/camera/pixel_ray.h"
#include "core/structure/bundle_blocks.h"
#include "core/structure/camera_sensitivity.h"
#include "core/structure/schur_solver.h"

namespace cairn::reconstruct {
namespace {

// Sensitivities hold for so large a change, in standard deviations of what is likely.
constexpr double kMaxChangeSigmas = 0.5;
// In typical steps.
constexpr double kSmoothLength = 0.1, kHalfAStep = 0.5;

// Standard deviation of the ratio of a camera's two focal lengths: pixels are square, or were calibrated.
constexpr double kAspectSigma = 0.001;

// Changes of a camera, about what is stated; and of the ratio of its focal lengths, where it has two.  A
// level camera that moves on a flat floor sees none of that ratio: heights grow with it.
class CameraPriorCost : public ceres::CostFunction {
 public:
  explicit CameraPriorCost(const FreeCamera& camera)
      : camera_(camera),
        has_aspect_(NumFocals(camera.stated.model) == 2 && camera.free.size() >= 2 && camera.free[0] == 0 &&
                    camera.free[1] == 1) {
    set_num_residuals(static_cast<int>(camera.free.size()) + has_aspect_);
    mutable_parameter_block_sizes()->push_back(static_cast<int>(camera.free.size()));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const size_t n = camera_.free.size();
    for (size_t i = 0; i < n; ++i) {
      const int p = camera_.free[i];
      residuals[i] =
          (camera_.camera.params[p] + parameters[0][i] - camera_.stated.params[p]) / camera_.sigma[i];
    }
    const PooledVector<double>& stated = camera_.stated.params;
    if (has_aspect_) {
      residuals[n] = ((camera_.camera.params[0] + parameters[0][0]) / stated[0] -
                      (camera_.camera.params[1] + parameters[0][1]) / stated[1]) /
                     kAspectSigma;
    }
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    for (size_t i = 0; i < n; ++i) {
      for (size_t k = 0; k < n; ++k) jacobians[0][i * n + k] = i == k ? 1 / camera_.sigma[i] : 0;
    }
    if (has_aspect_) {
      std::fill_n(jacobians[0] + n * n, n, 0.0);
      jacobians[0][n * n] = 1 / (stated[0] * kAspectSigma);
      jacobians[0][n * n + 1] = -1 / (stated[1] * kAspectSigma);
    }
    return true;
  }

 private:
  const FreeCamera& camera_;
  bool has_aspect_;
};

struct RelativeRotationCost {
  Eigen::Quaterniond cam2_from_cam1;
  double sigma_rad;
  template <typename T>
  bool operator()(const T* pose1, const T* pose2, T* residual) const {
    const Eigen::Quaternion<T> q = PoseView<T>(pose2).rotation * PoseView<T>(pose1).rotation.conjugate() *
                                   cam2_from_cam1.conjugate().cast<T>();
    Eigen::Map<Eigen::Matrix<T, 3, 1>> out(residual);
    out = RotationVector(q) / T(sigma_rad);
    return true;
  }
};

// The length of a step, in typical ones.  Smooth where nothing moves.
struct StepLengthCost {
  double unit, length, sigma;
  template <typename T>
  bool operator()(const T* pose1, const T* pose2, T* residual) const {
    const auto center = [](const T* pose) {
      const PoseView<T> view(pose);
      return Eigen::Matrix<T, 3, 1>(-(view.rotation.conjugate() * view.translation));
    };
    const Eigen::Matrix<T, 3, 1> way = (center(pose2) - center(pose1)) / T(unit);
    residual[0] = (ceres::sqrt(way.squaredNorm() + T(kSmoothLength * kSmoothLength)) -
                   T(std::hypot(length, kSmoothLength))) /
                  T(sigma);
    return true;
  }
};

ceres::CostFunction* MakeMotionCost(const AdjustModelOptions& options, const ImageMotion& motion,
                                    double median_way_m) {
  const double turn_rad = RadFromDeg(RotationErrorDeg(motion.cam2_from_cam1, Pose()));
  return new ceres::AutoDiffCostFunction<MotionCost, 6, kPoseBlockSize, kPoseBlockSize>(
      new MotionCost{motion.cam2_from_cam1,
                     std::hypot(RadFromDeg(options.turn_sigma_deg), options.turn_sigma_ratio * turn_rad),
                     std::hypot(options.way_sigma_ratio * motion.Way().norm(),
                                options.least_way_sigma_ratio * median_way_m)});
}

// The length of a typical step, by those that are likely to be at least half of one; 0: there are none.
double TypicalStep(const ModelProblem& problem) {
  std::vector<double> ratios;
  for (const ModelStep& step : problem.steps) {
    if (step.length < kHalfAStep) continue;
    ratios.push_back(CenterErrorM(problem.cam_from_world[step.from], problem.cam_from_world[step.to]) /
                     step.length);
  }
  return ratios.empty() ? 0 : UpperMedian(ratios);
}

// The image that holds the frame: that with most observations where there are motions.  The first of a drive
// has few, and would be held off what all others say of it.  Without motions the first holds it all the same:
// adjustments that end early leave weak images farther off else.  REQUIRES: an observation
size_t HoldingFrame(const ModelProblem& problem) {
  if (problem.motions.empty()) {
    int first = problem.observations.front().image;
    for (const ModelObservation& observation : problem.observations)
      first = std::min(first, observation.image);
    return static_cast<size_t>(first);
  }
  std::vector<int> count(problem.cam_from_world.size(), 0);
  for (const ModelObservation& observation : problem.observations) ++count[observation.image];
  return std::max_element(count.begin(), count.end()) - count.begin();
}

std::vector<int> HeldImages(const ModelProblem& problem) {
  std::vector<int> held;
  for (size_t i = 0; i < problem.is_held.size(); ++i) {
    if (problem.is_held[i]) held.push_back(static_cast<int>(i));
  }
  if (held.empty() && !problem.observations.empty()) held.push_back(static_cast<int>(HoldingFrame(problem)));
  return held;
}

struct Seen {
  std::optional<PixelRay> ray;
  CameraSensitivity sensitivity;
};

std::vector<Seen> SeeAll(const AdjustModelOptions& options, const ModelProblem& problem) {
  std::vector<Seen> seen(problem.observations.size());
  ParallelFor(std::ssize(seen), options.num_threads, [&](int64_t k) {
    const ModelObservation& observation = problem.observations[k];
    const FreeCamera& camera = problem.cameras[problem.camera_idx[observation.image]];
    seen[k].ray = MakePixelRay(camera.camera, observation.pixel);
    if (seen[k].ray && options.adjust_cameras)
      seen[k].sensitivity = SensitivityOf(camera.camera, observation.pixel, camera.free);
  });
  return seen;
}

}  // namespace

void AdjustModel(const AdjustModelOptions& options, ModelProblem* problem) {
  const size_t num_images = problem->cam_from_world.size();
  const std::vector<Seen> seen = SeeAll(options, *problem);
  PoseManifold manifold;
  SchurProblem schur;
  std::vector<double> poses(kPoseBlockSize * num_images);
  for (size_t i = 0; i < num_images; ++i) {
    StorePose(problem->cam_from_world[i], &poses[kPoseBlockSize * i]);
    schur.AddBlock(&poses[kPoseBlockSize * i], kPoseBlockSize, &manifold);
  }
  const auto point_block = [&](int point) { return static_cast<int>(num_images) + point; };
  for (Eigen::Vector3d& point : problem->points) schur.AddPoint(point.data());
  std::vector<std::vector<double>> changes;  // per camera
  std::vector<int> camera_block;
  for (const FreeCamera& camera : problem->cameras) {
    changes.emplace_back(camera.free.size(), 0);
    camera_block.push_back(schur.AddBlock(changes.back().data(), static_cast<int>(camera.free.size())));
  }

  ceres::CauchyLoss loss(options.loss_scale_px);
  BundleCosts costs;
  std::vector<bool> is_camera_used(problem->cameras.size(), false), is_known(num_images, false);
  for (size_t k = 0; k < seen.size(); ++k) {
    if (!seen[k].ray) continue;
    const ModelObservation& observation = problem->observations[k];
    const int point = point_block(observation.point);
    const ceres::CostFunction* cost = costs.AddReprojection(*seen[k].ray, seen[k].sensitivity, 1);
    is_known[observation.image] = true;
    if (seen[k].sensitivity.empty()) {
      schur.AddResidual(cost, &loss, {observation.image, point});
    } else {
      const int c = problem->camera_idx[observation.image];
      is_camera_used[c] = true;
      schur.AddResidual(cost, &loss, {observation.image, point, camera_block[c]});
    }
  }
  ceres::CauchyLoss weak_loss(1);
  for (const RelativeRotation& rotation : problem->rotations) {
    if (!is_known[rotation.image1] || !is_known[rotation.image2]) continue;
    schur.AddResidual(
        costs.Add(new ceres::AutoDiffCostFunction<RelativeRotationCost, 3, kPoseBlockSize, kPoseBlockSize>(
            new RelativeRotationCost{rotation.cam2_from_cam1, RadFromDeg(options.rotation_sigma_deg)})),
        rotation.is_sure ? nullptr : &weak_loss, {rotation.image1, rotation.image2});
  }
  const double typical_step = TypicalStep(*problem);
  for (const ModelStep& step : problem->steps) {
    if (!(typical_step > 0) || !is_known[step.from] || !is_known[step.to]) continue;
    schur.AddResidual(
        costs.Add(new ceres::AutoDiffCostFunction<StepLengthCost, 1, kPoseBlockSize, kPoseBlockSize>(
            new StepLengthCost{typical_step, step.length, options.step_sigma})),
        &weak_loss, {step.from, step.to});
  }
  const double median_way_m = MedianWayM(problem->motions);
  for (const ImageMotion& motion : problem->motions) {
    if (!(median_way_m > 0) || !is_known[motion.image1] || !is_known[motion.image2]) continue;
    schur.AddResidual(costs.Add(MakeMotionCost(options, motion, median_way_m)), &weak_loss,
                      {motion.image1, motion.image2});
  }
  for (const int i : HeldImages(*problem)) schur.SetConstant(i);
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    const FreeCamera& camera = problem->cameras[c];
    if (!is_camera_used[c]) {
      schur.SetConstant(camera_block[c]);
      continue;
    }
    schur.AddResidual(costs.Add(new CameraPriorCost(camera)), nullptr, {camera_block[c]});
    for (size_t k = 0; k < camera.free.size(); ++k) {
      const double most = kMaxChangeSigmas * camera.sigma[k];
      schur.SetBounds(camera_block[c], static_cast<int>(k), -most, most);
    }
  }
  const auto start = std::chrono::steady_clock::now();
  const SchurSummary summary = SolveSchur(schur, {.max_num_iterations = options.max_num_iterations,
                                                  .function_tolerance = options.function_tolerance,
                                                  .num_threads = options.num_threads,
                                                  .progress = options.progress});
  spdlog::debug(
      "reconstruct: {} points and {} observations adjusted in {} steps: cost {:.6g} -> {:.6g}; {:.1f} s",
      problem->points.size(), problem->observations.size(), summary.num_steps, summary.initial_cost,
      summary.final_cost, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  for (size_t i = 0; i < num_images; ++i) problem->cam_from_world[i] = LoadPose(&poses[kPoseBlockSize * i]);
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    FreeCamera& camera = problem->cameras[c];
    for (size_t k = 0; k < camera.free.size(); ++k) camera.camera.params[camera.free[k]] += changes[c][k];
  }
}

}  // namespace cairn::reconstruct
