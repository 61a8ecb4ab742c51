#include "stages/group_classes/adjust/bundle.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include <ceres/ceres.h>
#include <spdlog/spdlog.h>
#include <Eigen/LU>
#include <Eigen/Sparse>

#include "core/structure/bundle_blocks.h"
#include "stages/group_classes/adjust/bundle_solution.h"
#include "stages/group_classes/adjust/evidence.h"
#include "stages/group_classes/adjust/solved_file.h"

namespace cairn::group_classes {
namespace {

// Points follow steps for as long as that lowers the cost by more than this part.
constexpr double kFollowTolerance = 1e-6;

// A camera's pose against the one that the drifted stated pose and the offset give: rotation, centre.
struct OwnErrorCost {
  double sigma_rad, sigma_m;
  template <typename T>
  bool operator()(const T* pose, const T* drifted, const T* offset, T* residual) const {
    const PoseView<T> a(pose), d(drifted), o(offset);
    const Eigen::Quaternion<T> q = o.rotation * d.rotation;
    const Eigen::Matrix<T, 3, 1> t = o.rotation * d.translation + o.translation;
    const Eigen::Quaternion<T> difference = a.rotation * q.conjugate();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residual);
    out.template head<3>() = RotationVector(difference) / T(sigma_rad);
    // In the camera's frame.
    out.template tail<3>() = (a.translation - difference * t) / T(sigma_m);
    return true;
  }
};

struct OffsetPriorCost {
  double sigma_rad, sigma_m;
  template <typename T>
  bool operator()(const T* offset, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] = T(2) * offset[i] / T(sigma_rad);
      residual[3 + i] = offset[4 + i] / T(sigma_m);
    }
    return true;
  }
};

// A linear cost over one camera's change.
class CameraPrior : public ceres::CostFunction {
 public:
  explicit CameraPrior(const CameraBlock& camera) : camera_(camera) {
    set_num_residuals(static_cast<int>(NumRows(camera)));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(camera.free.size()));
  }

  static size_t NumRows(const CameraBlock& camera) {
    return camera.free.size() + (camera.difference_sigma > 0 ? 1 : 0);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const size_t n = camera_.free.size();
    const double* delta = parameters[0];
    for (size_t i = 0; i < n; ++i) residuals[i] = (delta[i] - camera_.prior[i]) / camera_.sigma[i];
    if (camera_.difference_sigma > 0)
      residuals[n] = (delta[0] - delta[1] - camera_.difference_prior) / camera_.difference_sigma;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    std::fill_n(jacobians[0], NumRows(camera_) * n, 0.0);
    for (size_t i = 0; i < n; ++i) jacobians[0][i * n + i] = 1 / camera_.sigma[i];
    if (camera_.difference_sigma > 0) {
      jacobians[0][n * n] = 1 / camera_.difference_sigma;
      jacobians[0][n * n + 1] = -1 / camera_.difference_sigma;
    }
    return true;
  }

 private:
  const CameraBlock& camera_;
};

// Between two steps.
class StepCallback : public ceres::IterationCallback {
 public:
  explicit StepCallback(const BundleOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    if (options_.steps != nullptr && step.iteration > 0) options_.steps->Advance();
    const bool is_cancelled = options_.cancel != nullptr && options_.cancel->Cancelled();
    return is_cancelled ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const BundleOptions& options_;
};

// The whole problem in Ceres, over copies of the poses.
class CeresBundle {
 public:
  CeresBundle(const BundleOptions& options, BundleProblem* problem)
      : options_(options),
        bundle_(*problem),
        num_images_(problem->images.size()),
        problem_(UncheckedProblem()) {
    AddParameters();
    for (const BundleProblem::Observation& observation : bundle_.observations) AddObservation(observation);
    for (size_t i = 0; i < bundle_.images.size(); ++i) AddStatedPose(i);
    if (bundle_.is_offset_free) {
      other_blocks_.push_back(problem_.AddResidualBlock(
          costs_.Add(new ceres::AutoDiffCostFunction<OffsetPriorCost, 6, 7>(
              new OffsetPriorCost{RadFromDeg(bundle_.offset_sigma_deg), bundle_.offset_sigma_m})),
          nullptr, Offset()));
    }
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      const CameraBlock& camera = bundle_.cameras[c];
      if (camera.free.empty()) continue;
      other_blocks_.push_back(
          problem_.AddResidualBlock(costs_.Add(new CameraPrior(camera)), nullptr, Delta(c)));
    }
  }

  BundleOutcome Solve() {
    ceres::Solver::Options options;
    options.linear_solver_ordering = ordering_;
    options.max_num_iterations = options_.max_num_iterations;
    options.function_tolerance = options_.function_tolerance;
    options.initial_trust_region_radius = options_.initial_trust_region_radius;
    if (options_.points_follow) {
      options.use_inner_iterations = true;
      options.inner_iteration_tolerance = kFollowTolerance;
      options.inner_iteration_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
      for (Eigen::Vector3d& point : bundle_.points)
        options.inner_iteration_ordering->AddElementToGroup(point.data(), 0);
    }
    StepCallback callback(options_);
    options.callbacks.push_back(&callback);
    const ceres::Solver::Summary summary = SolveOnOneThread(options, &problem_);
    spdlog::debug(
        "group_classes: {} images, {} points, {} keypoints adjusted in {} steps: cost {:.6g} -> {:.6g}",
        num_images_, bundle_.points.size(), bundle_.observations.size(),
        summary.num_successful_steps + summary.num_unsuccessful_steps, summary.initial_cost,
        summary.final_cost);
    spdlog::debug("group_classes: {:.1f} s, of them {:.1f} s in the linear solver",
                  summary.total_time_in_seconds, summary.linear_solver_time_in_seconds);
    for (size_t i = 0; i < num_images_; ++i) {
      bundle_.images[i].cam_from_world = LoadPose(CamFromWorld(i));
      bundle_.images[i].drifted = LoadPose(Drifted(i));
    }
    bundle_.camera_from_given = LoadPose(Offset());
    for (size_t c = 0; c < bundle_.cameras.size(); ++c)
      std::copy_n(Delta(c), bundle_.cameras[c].delta.size(), bundle_.cameras[c].delta.begin());
    BundleOutcome outcome;
    outcome.has_converged = summary.termination_type == ceres::CONVERGENCE;
    outcome.was_stopped = summary.termination_type == ceres::USER_FAILURE;
    if (!summary.iterations.empty()) {
      outcome.num_steps = static_cast<int>(summary.iterations.size()) - 1;
      outcome.trust_region_radius = summary.iterations.back().trust_region_radius;
    }
    return outcome;
  }

  BundleEvidence FindEvidence() {
    ceres::Problem::EvaluateOptions evaluate;
    for (Eigen::Vector3d& point : bundle_.points) evaluate.parameter_blocks.push_back(point.data());
    int column = 0;
    const auto add = [&](double* block, int size) {
      evaluate.parameter_blocks.push_back(block);
      return std::exchange(column, column + size);
    };
    for (size_t i = 0; i < num_images_; ++i) add(CamFromWorld(i), 6);
    for (size_t i = 1; i < num_images_; ++i) add(Drifted(i), 6);
    const int offset_column = bundle_.is_offset_free ? add(Offset(), 6) : -1;
    std::vector<int> camera_columns;
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      const auto size = static_cast<int>(bundle_.cameras[c].free.size());
      camera_columns.push_back(size == 0 ? -1 : add(Delta(c), size));
    }
    // Rows of the stated poses first.
    evaluate.residual_blocks = stated_pose_blocks_;
    evaluate.residual_blocks.insert(evaluate.residual_blocks.end(), other_blocks_.begin(),
                                    other_blocks_.end());
    std::vector<double> residuals;
    ceres::CRSMatrix matrix;
    problem_.Evaluate(evaluate, nullptr, &residuals, nullptr, &matrix);
    const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> jacobian(
        matrix.num_rows, matrix.num_cols, static_cast<Eigen::Index>(matrix.values.size()), matrix.rows.data(),
        matrix.cols.data(), matrix.values.data());
    const ReducedSystem system(jacobian, static_cast<int>(bundle_.points.size()));
    BundleEvidence evidence;
    if (!system.ok()) return evidence;
    for (const bool is_walk : {false, true}) {
      for (const bool is_rotation : {false, true}) {
        std::vector<int> rows;
        NoiseEvidence found;
        for (size_t block = 0; block < stated_pose_blocks_.size(); ++block) {
          if (is_walk_block_[block] != is_walk) continue;
          for (int k = 0; k < 3; ++k) {
            rows.push_back(static_cast<int>(6 * block) + (is_rotation ? k : 3 + k));
            found.sum_of_squares += residuals[rows.back()] * residuals[rows.back()];
          }
        }
        found.num_residuals = static_cast<double>(rows.size());
        found.num_determined = found.num_residuals - system.Trace(rows);
        (is_walk ? (is_rotation ? evidence.walk_deg : evidence.walk_m)
                 : (is_rotation ? evidence.own_deg : evidence.own_m)) = found;
      }
    }
    if (offset_column >= 0) {
      // Tangent of the quaternion: half the rotation.
      Eigen::Matrix<double, 6, 1> offset;
      offset << bundle_.camera_from_given.rotation.vec() *
                    (bundle_.camera_from_given.rotation.w() < 0 ? -1 : 1),
          bundle_.camera_from_given.translation;
      evidence.offset_chi_square = offset.dot(system.Covariance(offset_column, 6).inverse() * offset);
    }
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      std::vector<double>& sigma = evidence.camera_sigma.emplace_back();
      if (camera_columns[c] < 0) continue;
      const auto size = static_cast<int>(bundle_.cameras[c].free.size());
      const Eigen::MatrixXd covariance = system.Covariance(camera_columns[c], size);
      for (int i = 0; i < size; ++i) sigma.push_back(std::sqrt(covariance(i, i)));
    }
    return evidence;
  }

 private:
  double* CamFromWorld(size_t image) { return &values_[size_t{kPoseBlockSize} * image]; }
  double* Drifted(size_t image) { return &values_[size_t{kPoseBlockSize} * (num_images_ + image)]; }
  double* Offset() { return &values_[size_t{kPoseBlockSize} * 2 * num_images_]; }
  double* Delta(size_t camera) { return &values_[first_delta_[camera]]; }

  void AddParameters() {
    first_delta_.push_back(size_t{kPoseBlockSize} * (2 * num_images_ + 1));
    for (const CameraBlock& camera : bundle_.cameras)
      first_delta_.push_back(first_delta_.back() + camera.free.size());
    values_.resize(first_delta_.back() + 1);
    for (Eigen::Vector3d& point : bundle_.points) {
      problem_.AddParameterBlock(point.data(), 3);
      ordering_->AddElementToGroup(point.data(), 0);
    }
    const auto add_pose = [&](const Pose& pose, double* block) {
      StorePose(pose, block);
      problem_.AddParameterBlock(block, kPoseBlockSize, &manifold_);
      ordering_->AddElementToGroup(block, 1);
    };
    for (size_t i = 0; i < num_images_; ++i) {
      const BundleProblem::Image& image = bundle_.images[i];
      add_pose(image.cam_from_world, CamFromWorld(i));
      add_pose(image.drifted, Drifted(i));
      losses_.push_back(std::make_unique<ceres::ScaledLoss>(new ceres::CauchyLoss(options_.loss_scale),
                                                            1 / image.dispersion, ceres::TAKE_OWNERSHIP));
    }
    add_pose(bundle_.camera_from_given, Offset());
    if (!bundle_.is_offset_free) problem_.SetParameterBlockConstant(Offset());
    if (num_images_ > 0) problem_.SetParameterBlockConstant(Drifted(0));
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      const CameraBlock& camera = bundle_.cameras[c];
      if (camera.free.empty()) continue;
      std::copy(camera.delta.begin(), camera.delta.end(), Delta(c));
      problem_.AddParameterBlock(Delta(c), static_cast<int>(camera.free.size()));
      ordering_->AddElementToGroup(Delta(c), 1);
    }
  }

  void AddObservation(const BundleProblem::Observation& observation) {
    const int camera_idx = bundle_.images[observation.image_idx].camera_idx;
    const CameraBlock& camera = bundle_.cameras[camera_idx];
    std::vector<double*> blocks = {CamFromWorld(observation.image_idx),
                                   bundle_.points[observation.point_idx].data()};
    if (!camera.free.empty()) blocks.push_back(Delta(camera_idx));
    other_blocks_.push_back(problem_.AddResidualBlock(
        costs_.AddReprojection(observation.ray, observation.camera, observation.sigma_px),
        losses_[observation.image_idx].get(), blocks));
  }

  void AddStatedPose(size_t i) {
    const BundleProblem::Image& image = bundle_.images[i];
    const PoseNoise& noise = bundle_.noise;
    stated_pose_blocks_.push_back(
        problem_.AddResidualBlock(costs_.Add(new ceres::AutoDiffCostFunction<OwnErrorCost, 6, 7, 7, 7>(
                                      new OwnErrorCost{RadFromDeg(noise.own_deg), noise.own_m})),
                                  nullptr, CamFromWorld(i), Drifted(i), Offset()));
    is_walk_block_.push_back(false);
    if (i == 0) return;
    const double root = std::sqrt(image.way_m);
    stated_pose_blocks_.push_back(problem_.AddResidualBlock(
        costs_.Add(new ceres::AutoDiffCostFunction<MotionCost, 6, 7, 7>(
            new MotionCost{image.stated * bundle_.images[i - 1].stated.Inverse(),
                           RadFromDeg(noise.walk_deg) * root, noise.walk_m * root})),
        nullptr, Drifted(i - 1), Drifted(i)));
    is_walk_block_.push_back(true);
  }

  BundleOptions options_;
  BundleProblem& bundle_;
  size_t num_images_;
  // All parameters but the points, in one piece: Ceres orders them by their addresses, and another order is
  // another rounding.
  std::vector<double> values_;
  std::vector<size_t> first_delta_;                           // per camera
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;  // per image
  BundleCosts costs_;
  PoseManifold manifold_;
  ceres::Problem problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_ =
      std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<ceres::ResidualBlockId> other_blocks_, stated_pose_blocks_;
  std::vector<bool> is_walk_block_;  // per block of a stated pose
};

BundleOutcome AdjustOnce(const BundleOptions& options, BundleProblem* problem, BundleEvidence* evidence) {
  ContentHash hash;
  if (options.solved != nullptr) {
    hash = HashBundle(options, *problem, evidence != nullptr);
    if (const auto solution = options.solved->Find(hash)) {
      if (const auto outcome = ReadSolution(*solution, problem, evidence)) {
        if (options.steps != nullptr) options.steps->Advance(outcome->num_steps);
        return *outcome;
      }
    }
  }
  CeresBundle bundle(options, problem);
  const BundleOutcome outcome = bundle.Solve();
  if (outcome.was_stopped) return outcome;
  if (evidence != nullptr) *evidence = bundle.FindEvidence();
  if (options.solved != nullptr) options.solved->Add(hash, WriteSolution(*problem, outcome, evidence));
  return outcome;
}

}  // namespace

Eigen::Vector2d ResidualOf(const BundleProblem& problem, const BundleProblem::Observation& observation) {
  const BundleProblem::Image& image = problem.images[observation.image_idx];
  const CameraBlock& camera = problem.cameras[image.camera_idx];
  const Eigen::Vector2d before =
      observation.ray.Residual(image.cam_from_world * problem.points[observation.point_idx]);
  Eigen::Vector2d residual = before;
  for (size_t p = 0; p < camera.free.size(); ++p)
    residual += camera.delta[p] * (observation.camera[p].by_param + observation.camera[p].growth * before);
  return residual;
}

bool AdjustBundle(const BundleOptions& options, BundleProblem* problem, BundleEvidence* evidence) {
  BundleOptions piece = options;
  for (int num_left = options.max_num_iterations;;) {
    if (options.num_steps_at_once > 0)
      piece.max_num_iterations = std::min(num_left, options.num_steps_at_once);
    const BundleOutcome outcome = AdjustOnce(piece, problem, evidence);
    num_left -= outcome.num_steps;
    const bool has_ended = outcome.has_converged || outcome.was_stopped ||
                           outcome.num_steps < piece.max_num_iterations || num_left <= 0;
    if (has_ended) return outcome.has_converged;
    piece.initial_trust_region_radius = outcome.trust_region_radius;
  }
}

}  // namespace cairn::group_classes
