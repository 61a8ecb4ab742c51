#pragma once

#include <deque>
#include <memory>
#include <vector>

#include <ceres/ceres.h>
#include <Eigen/Core>

#include "core/camera/pixel_ray.h"
#include "core/geometry/pose.h"
#include "core/structure/camera_sensitivity.h"

namespace cairn {

// What bundle adjustments in Ceres consist of.

// A pose as a parameter block: quaternion x, y, z, w; translation.
inline constexpr int kPoseBlockSize = 7;
using PoseManifold = ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;
void StorePose(const Pose& pose, double* block);
Pose LoadPose(const double* block);
template <typename T>
struct PoseView {
  explicit PoseView(const T* array) : rotation(array), translation(array + 4) {}
  Eigen::Map<const Eigen::Quaternion<T>> rotation;
  Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation;
};

// Of a small turn.
template <typename T>
Eigen::Matrix<T, 3, 1> RotationVector(const Eigen::Quaternion<T>& q) {
  return (q.w() < T(0) ? T(-2) : T(2)) * q.vec();
}

// Reprojection of a point, in units of the keypoint's standard deviation, with analytic derivatives.  Blocks:
// pose, point, and the changes of the camera's parameters where the sensitivity has any.
class ReprojectionCost : public ceres::CostFunction {
 public:
  // Refers to its arguments.
  ReprojectionCost(const PixelRay& ray, const CameraSensitivity& camera, double sigma_px);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const PixelRay& ray_;
  const CameraSensitivity& camera_;
  double weight_;
};

// The costs of a problem that refers to them, side by side.
class BundleCosts {
 public:
  // Refers to its arguments, as ReprojectionCost does.
  ceres::CostFunction* AddReprojection(const PixelRay& ray, const CameraSensitivity& camera,
                                       double sigma_px) {
    return &reprojections_.emplace_back(ray, camera, sigma_px);
  }
  // Takes ownership.
  ceres::CostFunction* Add(ceres::CostFunction* cost) { return others_.emplace_back(cost).get(); }

 private:
  std::deque<ReprojectionCost> reprojections_;
  std::vector<std::unique_ptr<ceres::CostFunction>> others_;
};

// The motion between two images, later_from_earlier, against one that is stated: turn, then the translation.
// Blocks: the earlier pose, the later one.
struct MotionCost {
  Pose motion;  // stated
  double sigma_rad, sigma_m;
  template <typename T>
  bool operator()(const T* earlier, const T* later, T* residual) const {
    const PoseView<T> a(earlier), b(later);
    const Eigen::Quaternion<T> q = b.rotation * a.rotation.conjugate();
    const Eigen::Matrix<T, 3, 1> t = b.translation - q * a.translation;
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residual);
    out.template head<3>() =
        RotationVector(Eigen::Quaternion<T>(q * motion.rotation.conjugate().cast<T>())) / T(sigma_rad);
    out.template tail<3>() = (t - motion.translation.cast<T>()) / T(sigma_m);
    return true;
  }
};

// By sparse Cholesky, on one thread: bit-stable.  Sets what the options say of solver and threads.
ceres::Solver::Summary SolveOnOneThread(ceres::Solver::Options options, ceres::Problem* problem);

}  // namespace cairn
