#include "stages/group_classes/refine_poses.h"

#include <cmath>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

namespace cairn::group_classes {
namespace {

// Reprojection of a point, in units of the keypoint's standard deviation.
struct ReprojectionCost {
  PixelRay ray;
  double weight;  // 1 / sigma

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* point, const T* focal_ratio,
                  T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Matrix<T, 3, 1> p = q * Eigen::Map<const Eigen::Matrix<T, 3, 1>>(point) +
                                     Eigen::Map<const Eigen::Matrix<T, 3, 1>>(translation);
    const Eigen::Matrix<T, 3, 1> scaled(focal_ratio[0] * p.x(), focal_ratio[0] * p.y(), p.z());
    const T depth = ray.normal.cast<T>().dot(scaled);
    Eigen::Map<Eigen::Matrix<T, 2, 1>> out(residual);
    out = ray.pixel_from_plane.cast<T>() * scaled * (T(weight) / depth);
    return true;
  }
};

// Difference between a camera's pose and where its stated pose and the common offset put it.
struct StatedPoseCost {
  Pose stated;
  double sigma_rad;
  double sigma_m;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* offset_rotation,
                  const T* offset_translation, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation), offset_q(offset_rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation), offset_t(offset_translation);
    const Eigen::Quaternion<T> expected_q = offset_q * stated.rotation.cast<T>();
    const Eigen::Matrix<T, 3, 1> expected_t = offset_q * stated.translation.cast<T>() + offset_t;
    const Eigen::Quaternion<T> difference = q * expected_q.conjugate();
    const T sign = difference.w() < T(0) ? T(-1) : T(1);
    const Eigen::Matrix<T, 3, 1> center = q.conjugate() * t;  // minus the centre
    const Eigen::Matrix<T, 3, 1> expected_center = expected_q.conjugate() * expected_t;
    for (int i = 0; i < 3; ++i) {
      residual[i] = T(2) * sign * difference.vec()[i] / T(sigma_rad);
      residual[3 + i] = (center[i] - expected_center[i]) / T(sigma_m);
    }
    return true;
  }
};

struct OffsetPriorCost {
  double sigma_rad;
  double sigma_m;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] = T(2) * rotation[i] / T(sigma_rad);
      residual[3 + i] = translation[i] / T(sigma_m);
    }
    return true;
  }
};

struct FocalPriorCost {
  double sigma;
  template <typename T>
  bool operator()(const T* focal_ratio, T* residual) const {
    residual[0] = (focal_ratio[0] - T(1)) / T(sigma);
    return true;
  }
};

double RmsErrorPx(const PoseProblem& problem) {
  double total = 0;
  for (const PoseProblem::Observation& o : problem.observations) {
    const Eigen::Vector3d p = problem.poses[o.image_idx] * problem.points[o.point_idx];
    const double ratio = problem.focal_ratios[problem.camera_idx[o.image_idx]];
    total += o.ray.Residual({ratio * p.x(), ratio * p.y(), p.z()}).squaredNorm();
  }
  return std::sqrt(total / static_cast<double>(std::max<size_t>(1, problem.observations.size())));
}

}  // namespace

RefinePosesSummary RefinePoses(const RefinePosesOptions& options, PoseProblem* problem) {
  RefinePosesSummary summary;
  summary.initial_rms_px = RmsErrorPx(*problem);

  ceres::Problem ceres_problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const PoseProblem::Observation& o : problem->observations) {
    Pose& pose = problem->poses[o.image_idx];
    ceres_problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ReprojectionCost, 2, 4, 3, 3, 1>(
                                       new ReprojectionCost{o.ray, 1 / options.keypoint_sigma_px}),
                                   new ceres::CauchyLoss(2.0), pose.rotation.coeffs().data(),
                                   pose.translation.data(), problem->points[o.point_idx].data(),
                                   &problem->focal_ratios[problem->camera_idx[o.image_idx]]);
    ordering->AddElementToGroup(problem->points[o.point_idx].data(), 0);
  }
  Pose& offset = problem->camera_from_given;
  for (size_t i = 0; i < problem->poses.size(); ++i) {
    Pose& pose = problem->poses[i];
    ceres_problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<StatedPoseCost, 6, 4, 3, 4, 3>(new StatedPoseCost{
            problem->stated_poses[i], RadFromDeg(options.pose_sigma_deg), options.pose_sigma_m}),
        nullptr, pose.rotation.coeffs().data(), pose.translation.data(), offset.rotation.coeffs().data(),
        offset.translation.data());
    ceres_problem.SetManifold(pose.rotation.coeffs().data(), new ceres::EigenQuaternionManifold);
    ordering->AddElementToGroup(pose.rotation.coeffs().data(), 1);
    ordering->AddElementToGroup(pose.translation.data(), 1);
  }
  ceres_problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<OffsetPriorCost, 6, 4, 3>(
          new OffsetPriorCost{RadFromDeg(options.offset_sigma_deg), options.offset_sigma_m}),
      nullptr, offset.rotation.coeffs().data(), offset.translation.data());
  ceres_problem.SetManifold(offset.rotation.coeffs().data(), new ceres::EigenQuaternionManifold);
  ordering->AddElementToGroup(offset.rotation.coeffs().data(), 1);
  ordering->AddElementToGroup(offset.translation.data(), 1);
  if (!options.refine_camera_offset) {
    ceres_problem.SetParameterBlockConstant(offset.rotation.coeffs().data());
    ceres_problem.SetParameterBlockConstant(offset.translation.data());
  }
  for (size_t c = 0; c < problem->focal_ratios.size(); ++c) {
    double* ratio = &problem->focal_ratios[c];
    ceres_problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<FocalPriorCost, 1, 1>(new FocalPriorCost{options.focal_sigma_ratio}),
        nullptr, ratio);
    ordering->AddElementToGroup(ratio, 1);
    if (!options.refine_focal || !problem->is_focal_refined[c])
      ceres_problem.SetParameterBlockConstant(ratio);
  }

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = ceres::SPARSE_SCHUR;
  solver_options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver_options.linear_solver_ordering = ordering;
  solver_options.num_threads = 1;
  solver_options.max_num_iterations = options.max_num_iterations;
  solver_options.function_tolerance = 1e-4;
  solver_options.logging_type = ceres::SILENT;
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(solver_options, &ceres_problem, &ceres_summary);
  for (Pose& pose : problem->poses) pose.rotation.normalize();
  offset.rotation.normalize();

  summary.final_rms_px = RmsErrorPx(*problem);
  summary.num_iterations = static_cast<int>(ceres_summary.iterations.size());
  summary.converged = ceres_summary.termination_type == ceres::CONVERGENCE;
  return summary;
}

}  // namespace cairn::group_classes
