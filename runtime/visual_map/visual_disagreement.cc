#include "runtime/visual_map/visual_disagreement.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "core/geometry/floor_pose.h"

namespace cairn {
namespace {

double TurnDeg(double from_deg, double to_deg) { return std::remainder(to_deg - from_deg, 360); }

}  // namespace

FloorFix FloorFixOf(const Localization& localization, const Pose& floor_from_world) {
  const Pose& cam_from_world = localization.cam_from_world;
  const FloorPose at = FloorPoseOf(cam_from_world, floor_from_world);
  // By differences along the six perturbations of the pose (Localization::covariance).
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 3, 6> jacobian;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i % 3);
    Pose change;
    if (i < 3) {
      change.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(kStep, Eigen::Vector3d::Unit(i)));
    } else {
      change.translation = step;
    }
    const FloorPose moved = FloorPoseOf(change * cam_from_world, floor_from_world);
    jacobian.col(i) << (moved.position - at.position) / kStep,
        RadFromDeg(TurnDeg(at.heading_deg, moved.heading_deg)) / kStep;
  }
  Matrix6d covariance = localization.covariance;
  covariance.bottomRightCorner<3, 3>() -= localization.scale_sigma_m * localization.scale_sigma_m.transpose();
  return {at.position, at.heading_deg, jacobian * covariance * jacobian.transpose()};
}

Disagreement Compare(const FloorFix& fix, const VisualPose& pose) {
  Eigen::Vector3d difference;
  difference << pose.position - fix.position, RadFromDeg(TurnDeg(fix.heading_deg, pose.heading_deg));
  Eigen::Matrix3d covariance = fix.covariance + pose.covariance;
  covariance.topLeftCorner<2, 2>() -= pose.scale_sigma_m * pose.scale_sigma_m.transpose();
  return {difference.head<2>().norm(), DegFromRad(std::abs(difference[2])),
          std::sqrt(std::max(0.0, difference.dot(covariance.ldlt().solve(difference))))};
}

}  // namespace cairn
