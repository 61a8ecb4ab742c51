#include "stages/group_classes/adjust/bundle.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>

#include <ceres/ceres.h>
#include <spdlog/spdlog.h>
#include <Eigen/LU>

#include "core/structure/bundle_blocks.h"
#include "core/structure/schur_solver.h"
#include "stages/group_classes/adjust/bundle_solution.h"
#include "stages/group_classes/adjust/evidence.h"
#include "stages/group_classes/adjust/solved_file.h"

namespace cairn::group_classes {
namespace {

double Square(double x) { return x * x; }

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

// What a solver asks whether it goes on, and tells its steps.
class StepProgress : public Progress {
 public:
  explicit StepProgress(const BundleOptions& options) : options_(options) {}
  void Begin(std::string_view, int64_t, std::string_view) override {}
  void Advance(int64_t num_steps) override {
    if (options_.steps != nullptr) options_.steps->Advance(num_steps);
  }
  void End() override {}
  bool Cancelled() const override { return options_.cancel != nullptr && options_.cancel->Cancelled(); }

 private:
  const BundleOptions& options_;
};

// The whole problem, over copies of the poses.
class SchurBundle {
 public:
  SchurBundle(const BundleOptions& options, BundleProblem* problem)
      : options_(options), bundle_(*problem), num_images_(problem->images.size()) {
    AddParameters();
    for (const BundleProblem::Observation& observation : bundle_.observations) AddObservation(observation);
    for (size_t i = 0; i < bundle_.images.size(); ++i) AddStatedPose(i);
    if (bundle_.is_offset_free) {
      problem_.AddResidual(
          costs_.Add(new ceres::AutoDiffCostFunction<OffsetPriorCost, 6, kPoseBlockSize>(
              new OffsetPriorCost{RadFromDeg(bundle_.offset_sigma_deg), bundle_.offset_sigma_m})),
          nullptr, {offset_block_});
    }
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      const CameraBlock& camera = bundle_.cameras[c];
      if (!camera.free.empty())
        problem_.AddResidual(costs_.Add(new CameraPrior(camera)), nullptr, {camera_block_[c]});
    }
  }

  BundleOutcome Solve() {
    StepProgress progress(options_);
    const auto start = std::chrono::steady_clock::now();
    const SchurSummary summary =
        SolveSchur(problem_, {.max_num_iterations = options_.max_num_iterations,
                              .function_tolerance = options_.function_tolerance,
                              .initial_trust_region_radius = options_.initial_trust_region_radius,
                              .points_follow = options_.points_follow,
                              .num_threads = options_.num_threads,
                              .progress = &progress});
    spdlog::debug(
        "group_classes: {} images, {} points, {} keypoints adjusted in {} steps: cost {:.6g} -> {:.6g}; "
        "{:.1f} s",
        num_images_, bundle_.points.size(), bundle_.observations.size(), summary.num_steps,
        summary.initial_cost, summary.final_cost,
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    for (size_t i = 0; i < num_images_; ++i) {
      if (bundle_.images[i].is_fixed) continue;  // to the bit
      bundle_.images[i].cam_from_world = LoadPose(ValuesOf(CamFromWorld(i)));
      bundle_.images[i].drifted = LoadPose(ValuesOf(Drifted(i)));
    }
    bundle_.camera_from_given = LoadPose(ValuesOf(offset_block_));
    return {summary.has_converged, summary.was_stopped, summary.num_steps, summary.trust_region_radius};
  }

  BundleEvidence FindEvidence() const {
    const ReducedSystem system(problem_, options_.num_threads);
    BundleEvidence evidence;
    if (!system.ok()) return evidence;
    for (const bool is_walk : {false, true}) {
      for (const bool is_rotation : {false, true}) {
        std::vector<ReducedSystem::Row> rows;
        NoiseEvidence found;
        for (const int residual : is_walk ? walks_ : own_errors_) {
          for (int k = 0; k < 3; ++k) {
            rows.push_back({residual, is_rotation ? k : 3 + k});
            found.sum_of_squares += Square(system.ValueOf(rows.back()));
          }
        }
        found.num_residuals = static_cast<double>(rows.size());
        found.num_determined = found.num_residuals - system.Trace(rows);
        (is_walk ? (is_rotation ? evidence.walk_deg : evidence.walk_m)
                 : (is_rotation ? evidence.own_deg : evidence.own_m)) = found;
      }
    }
    if (bundle_.is_offset_free) {
      // Tangent of the quaternion: half the rotation.
      Eigen::Matrix<double, 6, 1> offset;
      offset << bundle_.camera_from_given.rotation.vec() *
                    (bundle_.camera_from_given.rotation.w() < 0 ? -1 : 1),
          bundle_.camera_from_given.translation;
      evidence.offset_chi_square = offset.dot(system.Covariance(offset_block_).inverse() * offset);
    }
    for (size_t c = 0; c < bundle_.cameras.size(); ++c) {
      std::vector<double>& sigma = evidence.camera_sigma.emplace_back();
      if (bundle_.cameras[c].free.empty()) continue;
      const Eigen::MatrixXd covariance = system.Covariance(camera_block_[c]);
      for (Eigen::Index i = 0; i < covariance.rows(); ++i) sigma.push_back(std::sqrt(covariance(i, i)));
    }
    return evidence;
  }

 private:
  // Blocks: points, then a pose and a drifted pose of each image, the offset, cameras.
  int Point(int point) const { return point; }
  int CamFromWorld(size_t image) const { return static_cast<int>(bundle_.points.size() + 2 * image); }
  int Drifted(size_t image) const { return CamFromWorld(image) + 1; }
  const double* ValuesOf(int block) const { return problem_.blocks()[block].values; }

  void AddParameters() {
    for (Eigen::Vector3d& point : bundle_.points) problem_.AddPoint(point.data());
    poses_.resize(size_t{kPoseBlockSize} * (2 * num_images_ + 1));
    double* next = poses_.data();
    const auto add_pose = [&](const Pose& pose) {
      StorePose(pose, next);
      return problem_.AddBlock(std::exchange(next, next + kPoseBlockSize), kPoseBlockSize, &manifold_);
    };
    for (const BundleProblem::Image& image : bundle_.images) {
      const int pose = add_pose(image.cam_from_world), drifted = add_pose(image.drifted);
      if (image.is_fixed) {
        problem_.SetConstant(pose);
        problem_.SetConstant(drifted);
      }
      losses_.push_back(std::make_unique<ceres::ScaledLoss>(new ceres::CauchyLoss(options_.loss_scale),
                                                            1 / image.dispersion, ceres::TAKE_OWNERSHIP));
    }
    offset_block_ = add_pose(bundle_.camera_from_given);
    if (!bundle_.is_offset_free) problem_.SetConstant(offset_block_);
    // What holds the frame.
    const auto is_fixed = [](const BundleProblem::Image& image) { return image.is_fixed; };
    if (num_images_ > 0 && std::none_of(bundle_.images.begin(), bundle_.images.end(), is_fixed))
      problem_.SetConstant(Drifted(0));
    for (CameraBlock& camera : bundle_.cameras) {
      const auto size = static_cast<int>(camera.free.size());
      camera_block_.push_back(size == 0 ? -1 : problem_.AddBlock(camera.delta.data(), size));
    }
  }

  void AddObservation(const BundleProblem::Observation& observation) {
    const int camera = camera_block_[bundle_.images[observation.image_idx].camera_idx];
    const ceres::CostFunction* cost =
        costs_.AddReprojection(observation.ray, observation.camera, observation.sigma_px);
    const ceres::LossFunction* loss = losses_[observation.image_idx].get();
    const int pose = CamFromWorld(observation.image_idx), point = Point(observation.point_idx);
    if (camera < 0) {
      problem_.AddResidual(cost, loss, {pose, point});
    } else {
      problem_.AddResidual(cost, loss, {pose, point, camera});
    }
  }

  void AddStatedPose(size_t i) {
    const BundleProblem::Image& image = bundle_.images[i];
    const PoseNoise& noise = bundle_.noise;
    if (!image.is_fixed) {
      own_errors_.push_back(static_cast<int>(problem_.residuals().size()));
      problem_.AddResidual(costs_.Add(new ceres::AutoDiffCostFunction<OwnErrorCost, 6, kPoseBlockSize,
                                                                      kPoseBlockSize, kPoseBlockSize>(
                               new OwnErrorCost{RadFromDeg(noise.own_deg), noise.own_m})),
                           nullptr, {CamFromWorld(i), Drifted(i), offset_block_});
    }
    if (i == 0 || (image.is_fixed && bundle_.images[i - 1].is_fixed)) return;
    const double root = std::sqrt(image.way_m);
    walks_.push_back(static_cast<int>(problem_.residuals().size()));
    problem_.AddResidual(
        costs_.Add(new ceres::AutoDiffCostFunction<MotionCost, 6, kPoseBlockSize, kPoseBlockSize>(
            new MotionCost{image.stated * bundle_.images[i - 1].stated.Inverse(),
                           RadFromDeg(noise.walk_deg) * root, noise.walk_m * root})),
        nullptr, {Drifted(i - 1), Drifted(i)});
  }

  const BundleOptions& options_;
  BundleProblem& bundle_;
  size_t num_images_;
  std::vector<double> poses_;
  std::vector<std::unique_ptr<ceres::LossFunction>> losses_;  // per image
  BundleCosts costs_;
  PoseManifold manifold_;
  SchurProblem problem_;
  int offset_block_ = 0;
  std::vector<int> camera_block_;        // per camera; -1: none of it is free
  std::vector<int> own_errors_, walks_;  // residuals of stated poses
};

BundleOutcome AdjustOnce(const BundleOptions& options, BundleProblem* problem, BundleEvidence* evidence) {
  ContentHash hash;
  if (options.solved != nullptr) {
    hash = HashBundle(options, *problem, evidence != nullptr);
    if (const auto solution = options.solved->Find(hash)) {
      if (const auto outcome = ReadSolution(*solution, problem, evidence)) {
        if (options.steps != nullptr) options.steps->Advance(options.max_num_iterations);
        return *outcome;
      }
    }
  }
  SchurBundle bundle(options, problem);
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
  int num_told = 0;  // steps
  for (int num_left = options.max_num_iterations;;) {
    if (options.num_steps_at_once > 0)
      piece.max_num_iterations = std::min(num_left, options.num_steps_at_once);
    const BundleOutcome outcome = AdjustOnce(piece, problem, evidence);
    num_left -= outcome.num_steps;
    num_told += piece.max_num_iterations;
    const bool has_ended = outcome.has_converged || outcome.was_stopped ||
                           outcome.num_steps < piece.max_num_iterations || num_left <= 0;
    if (has_ended) {
      if (options.steps != nullptr && !outcome.was_stopped)
        options.steps->Advance(options.max_num_iterations - num_told);
      return outcome.has_converged;
    }
    piece.initial_trust_region_radius = outcome.trust_region_radius;
  }
}

}  // namespace cairn::group_classes
