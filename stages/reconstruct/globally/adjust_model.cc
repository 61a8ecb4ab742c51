#include "stages/reconstruct/globally/adjust_model.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <spdlog/spdlog.h>

#include "core/base/quantiles.h"
#include "core/camera/pixel_ray.h"
#include "core/structure/bundle_blocks.h"
#include "core/structure/camera_sensitivity.h"

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
    // To first order.
    const std::vector<double>& stated = camera_.stated.params;
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

std::vector<size_t> HeldImages(const ModelProblem& problem) {
  std::vector<size_t> held;
  for (size_t i = 0; i < problem.is_held.size(); ++i) {
    if (problem.is_held[i]) held.push_back(i);
  }
  if (held.empty() && !problem.observations.empty()) held.push_back(HoldingFrame(problem));
  return held;
}

struct Seen {
  PixelRay ray;
  CameraSensitivity sensitivity;
};

}  // namespace

void AdjustModel(const AdjustModelOptions& options, ModelProblem* problem) {
  // Poses, then changes of cameras, in one piece: Ceres orders blocks by their addresses, and another order
  // is another rounding.
  size_t num_values = kPoseBlockSize * problem->cam_from_world.size();
  std::vector<size_t> first_change;
  for (const FreeCamera& camera : problem->cameras) {
    first_change.push_back(num_values);
    num_values += camera.free.size();
  }
  std::vector<double> values(num_values, 0);
  const auto pose_of = [&](size_t image) { return &values[kPoseBlockSize * image]; };
  for (size_t i = 0; i < problem->cam_from_world.size(); ++i)
    StorePose(problem->cam_from_world[i], pose_of(i));

  std::vector<Seen> seen(problem->observations.size());
  PoseManifold manifold;
  ceres::CauchyLoss loss(options.loss_scale_px);
  BundleCosts costs;
  ceres::Problem ceres_problem(UncheckedProblem());
  std::vector<bool> is_camera_used(problem->cameras.size(), false);
  const std::vector<int> none;
  for (size_t k = 0; k < problem->observations.size(); ++k) {
    const ModelObservation& observation = problem->observations[k];
    const int c = problem->camera_idx[observation.image];
    const FreeCamera& camera = problem->cameras[c];
    const std::optional<PixelRay> ray = MakePixelRay(camera.camera, observation.pixel);
    if (!ray) continue;
    seen[k] = {*ray,
               SensitivityOf(camera.camera, observation.pixel, options.adjust_cameras ? camera.free : none)};
    std::vector<double*> blocks = {pose_of(observation.image), problem->points[observation.point].data()};
    if (!seen[k].sensitivity.empty()) {
      blocks.push_back(&values[first_change[c]]);
      is_camera_used[c] = true;
    }
    ceres_problem.AddResidualBlock(costs.AddReprojection(seen[k].ray, seen[k].sensitivity, 1), &loss, blocks);
  }
  ceres::CauchyLoss weak_loss(1);
  const auto are_known = [&](size_t a, size_t b) {
    return ceres_problem.HasParameterBlock(pose_of(a)) && ceres_problem.HasParameterBlock(pose_of(b));
  };
  for (const RelativeRotation& rotation : problem->rotations) {
    if (!are_known(rotation.image1, rotation.image2)) continue;
    ceres_problem.AddResidualBlock(
        costs.Add(new ceres::AutoDiffCostFunction<RelativeRotationCost, 3, kPoseBlockSize, kPoseBlockSize>(
            new RelativeRotationCost{rotation.cam2_from_cam1, RadFromDeg(options.rotation_sigma_deg)})),
        rotation.is_sure ? nullptr : &weak_loss, pose_of(rotation.image1), pose_of(rotation.image2));
  }
  const double typical_step = TypicalStep(*problem);
  for (const ModelStep& step : problem->steps) {
    if (!(typical_step > 0) || !are_known(step.from, step.to)) continue;
    ceres_problem.AddResidualBlock(
        costs.Add(new ceres::AutoDiffCostFunction<StepLengthCost, 1, kPoseBlockSize, kPoseBlockSize>(
            new StepLengthCost{typical_step, step.length, options.step_sigma})),
        &weak_loss, pose_of(step.from), pose_of(step.to));
  }
  const double median_way_m = MedianWayM(problem->motions);
  for (const ImageMotion& motion : problem->motions) {
    if (!(median_way_m > 0) || !are_known(motion.image1, motion.image2)) continue;
    ceres_problem.AddResidualBlock(costs.Add(MakeMotionCost(options, motion, median_way_m)), &weak_loss,
                                   pose_of(motion.image1), pose_of(motion.image2));
  }
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (Eigen::Vector3d& point : problem->points) {
    if (ceres_problem.HasParameterBlock(point.data())) ordering->AddElementToGroup(point.data(), 0);
  }
  for (const size_t i : HeldImages(*problem)) {
    if (ceres_problem.HasParameterBlock(pose_of(i))) ceres_problem.SetParameterBlockConstant(pose_of(i));
  }
  for (size_t i = 0; i < problem->cam_from_world.size(); ++i) {
    if (!ceres_problem.HasParameterBlock(pose_of(i))) continue;
    ceres_problem.SetManifold(pose_of(i), &manifold);
    ordering->AddElementToGroup(pose_of(i), 1);
  }
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    if (!is_camera_used[c]) continue;
    ceres_problem.AddResidualBlock(costs.Add(new CameraPriorCost(problem->cameras[c])), nullptr,
                                   &values[first_change[c]]);
    ordering->AddElementToGroup(&values[first_change[c]], 1);
    for (size_t k = 0; k < problem->cameras[c].free.size(); ++k) {
      const double most = kMaxChangeSigmas * problem->cameras[c].sigma[k];
      ceres_problem.SetParameterLowerBound(&values[first_change[c]], static_cast<int>(k), -most);
      ceres_problem.SetParameterUpperBound(&values[first_change[c]], static_cast<int>(k), most);
    }
  }
  ceres::Solver::Options solver;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  const ceres::Solver::Summary summary = SolveOnOneThread(solver, &ceres_problem, options.progress);
  spdlog::debug(
      "reconstruct: {} points and {} observations adjusted in {} steps: cost {:.6g} -> {:.6g}; {:.1f} s",
      problem->points.size(), problem->observations.size(),
      summary.num_successful_steps + summary.num_unsuccessful_steps, summary.initial_cost, summary.final_cost,
      summary.total_time_in_seconds);
  for (size_t i = 0; i < problem->cam_from_world.size(); ++i)
    problem->cam_from_world[i] = LoadPose(pose_of(i));
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    FreeCamera& camera = problem->cameras[c];
    for (size_t k = 0; k < camera.free.size(); ++k)
      camera.camera.params[camera.free[k]] += values[first_change[c] + k];
  }
}

}  // namespace cairn::reconstruct
