#include "core/structure/bundle_blocks.h"

#include <cmath>

#include "core/geometry/vector_geometry.h"

// Of OpenMP's runtime, which CHOLMOD brings along; <omp.h> comes with one compiler only.
extern "C" void omp_set_max_active_levels(int max_levels);

namespace cairn {

void StorePose(const Pose& pose, double* block) {
  Eigen::Map<Eigen::Vector4d> rotation(block);
  Eigen::Map<Eigen::Vector3d> translation(block + 4);
  rotation = pose.rotation.coeffs();
  translation = pose.translation;
}

Pose LoadPose(const double* block) {
  return {Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(block)).normalized(),
          Eigen::Map<const Eigen::Vector3d>(block + 4)};
}

ReprojectionCost::ReprojectionCost(const PixelRay& ray, const CameraSensitivity& camera, double sigma_px)
    : ray_(ray), camera_(camera), weight_(1 / sigma_px) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {kPoseBlockSize, 3};
  if (!camera.empty()) mutable_parameter_block_sizes()->push_back(static_cast<int>(camera.size()));
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  const Eigen::Map<const Eigen::Quaterniond> q(parameters[0]);
  const Eigen::Map<const Eigen::Vector3d> translation(parameters[0] + 4), point(parameters[1]);
  const Eigen::Matrix3d rotation = q.toRotationMatrix();
  const Eigen::Vector3d x = rotation * point + translation;
  const double depth = ray_.normal.dot(x);
  if (!(std::abs(depth) > 1e-12)) return false;
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = weight_ / depth * (ray_.pixel_from_plane * x);
  Eigen::Matrix<double, 2, 3> from_x;
  from_x = (weight_ * ray_.pixel_from_plane - residual * ray_.normal.transpose()) / depth;
  const size_t num_free = camera_.size();
  const Eigen::Vector2d before = residual;
  Eigen::Matrix2d growth = Eigen::Matrix2d::Identity();
  for (size_t p = 0; p < num_free; ++p) {
    residual += parameters[2][p] * (weight_ * camera_[p].by_param + camera_[p].growth * before);
    growth += parameters[2][p] * camera_[p].growth;
  }
  from_x = (growth * from_x).eval();
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    // x = p + 2 w (v x p) + 2 v x (v x p) + t of a unit quaternion (v, w).
    const Eigen::Vector3d v = q.vec();
    Eigen::Matrix<double, 3, 7> x_from_pose;
    x_from_pose.leftCols<3>() =
        -2 * q.w() * CrossMatrix(point) +
        2 * (v.dot(point) * Eigen::Matrix3d::Identity() + v * point.transpose() - 2 * point * v.transpose());
    x_from_pose.col(3) = 2 * v.cross(point);
    x_from_pose.rightCols<3>().setIdentity();
    Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> out(jacobians[0]);
    out = from_x * x_from_pose;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> out(jacobians[1]);
    out = from_x * rotation;
  }
  if (num_free > 0 && jacobians[2] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> out(
        jacobians[2], 2, static_cast<Eigen::Index>(num_free));
    for (size_t p = 0; p < num_free; ++p) {
      out.col(static_cast<Eigen::Index>(p)) = weight_ * camera_[p].by_param + camera_[p].growth * before;
    }
  }
  return true;
}

ceres::Solver::Summary SolveOnOneThread(ceres::Solver::Options options, ceres::Problem* problem) {
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  // CHOLMOD would start four threads for each thread that solves: slower here, and not what --memory counts.
  omp_set_max_active_levels(0);
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  return summary;
}

}  // namespace cairn
