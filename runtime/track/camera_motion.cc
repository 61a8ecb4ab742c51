#include "runtime/track/camera_motion.h"

#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>

#include "core/blocks/map_head.h"
#include "core/geometry/floor_pose.h"
#include "runtime/localize/refine.h"

namespace cairn {
namespace {

// Ways and turns whose errors are independent of those before (WheelErrorOptions).
constexpr double kWayM = 0.5;
constexpr double kTurnRad = 20 * std::numbers::pi / 180;
// Error of the way beside it, over that along it.
constexpr double kBeside = 1.0 / 3;

}  // namespace

OptionTable DescribeOptions(WheelErrorOptions* o) {
  return {
      {"wheel_way_ratio", &o->wheel_way_ratio,
       "standard deviation of each half metre that odometry states, as part of it", 0, 10},
      {"wheel_way_sigma_m", &o->wheel_way_sigma_m, "and in any case, since the last fix, m", 1e-6},
      {"wheel_turn_ratio", &o->wheel_turn_ratio, "the same of each 20 degrees of its turns", 0, 10},
      {"wheel_turn_sigma_deg", &o->wheel_turn_sigma_deg, "and in any case, since the last fix, degrees",
       1e-6},
      {"wheel_drift_deg", &o->wheel_drift_deg,
       "standard deviation of what the heading drifts in each half metre of the way, degrees", 0, 90},
  };
}

Eigen::Matrix3d WheelCovariance(const FloorMotion& motion, const WheelErrorOptions& errors) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const double way_m = motion.way_m.norm(), drift_rad = RadFromDeg(errors.wheel_drift_deg);
  if (way_m > 0) {
    const Eigen::Vector2d along = motion.way_m / way_m, beside(-along.y(), along.x());
    covariance.topLeftCorner<2, 2>() =
        errors.wheel_way_ratio * errors.wheel_way_ratio * kWayM * way_m *
        (along * along.transpose() + kBeside * kBeside * beside * beside.transpose());
  }
  covariance(2, 2) =
      errors.wheel_turn_ratio * errors.wheel_turn_ratio * kTurnRad * std::abs(motion.turn_left_rad) +
      drift_rad * drift_rad / kWayM * way_m;
  return covariance;
}

Status CheckUncertainPose(const UncertainPose& given) {
  const auto refuse = [](const char* what) {
    return MakeError(ErrorCode::kInvalidArgument, "a pose with its covariance: {}", what);
  };
  const Pose& pose = given.pose;
  const Matrix6d& covariance = given.covariance;
  if (!pose.rotation.coeffs().allFinite() || !pose.translation.allFinite() || !covariance.allFinite())
    return refuse("there are numbers that are not finite");
  if (!(std::abs(pose.rotation.norm() - 1) < 1e-3)) return refuse("the quaternion's length is not 1");
  constexpr double kRounding = 1e-9;
  const double most = kRounding * covariance.cwiseAbs().maxCoeff();
  if (!((covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= most))
    return refuse("the covariance is not symmetric");
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(covariance, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues().minCoeff() >= -most)) return refuse("the covariance has a negative variance");
  return Ok();
}

Status CheckFloorMotion(const FloorMotion& motion, const MapHead& map) {
  if (!motion.way_m.allFinite() || !std::isfinite(motion.turn_left_rad))
    return MakeError(ErrorCode::kInvalidArgument, "odometry: a way or a turn that is no number");
  if (IsMetric(map.frame)) return Ok();
  return MakeError(ErrorCode::kUnsupported,
                   "odometry is in metres, and the unit of map '{}' is not known; leave the odometry out",
                   map.name);
}

PlanarPose CameraOnFloor(const Pose& robot_from_camera) {
  if (robot_from_camera.rotation.vec().isZero(0) && robot_from_camera.translation.isZero(0)) return {};
  const FloorPose camera = FloorPoseOf(robot_from_camera.Inverse(), Pose());
  return {camera.position, WrapAngle(RadFromDeg(camera.heading_deg))};
}

FloorMotion OverFloor(const Pose& next_from_last) {
  const Pose last_from_next = next_from_last.Inverse();
  const Eigen::Vector3d ahead = last_from_next.rotation * Eigen::Vector3d::UnitZ();
  return {{last_from_next.translation.z(), -last_from_next.translation.x()},
          std::atan2(-ahead.x(), ahead.z())};
}

void MotionSinceFix::Add(const UncertainPose& next_from_last) {
  Pose step = next_from_last.pose;
  step.rotation.normalize();
  told_ = TransformCovariance(step, told_) + next_from_last.covariance;
  now_ = step * now_;
  is_told_ = true;
}

void MotionSinceFix::Add(const FloorMotion& motion, const Pose& floor_from_world,
                         const WheelErrorOptions& errors) {
  const FloorPose on_floor = FloorPoseOf(now_, floor_from_world);
  const Eigen::Vector2d way = Eigen::Rotation2Dd(RadFromDeg(on_floor.heading_deg)) * motion.way_m;
  const Pose floor_from_cam = floor_from_world * now_.Inverse();
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(motion.turn_left_rad, Eigen::Vector3d::UnitZ()));
  const Pose moved{turn * floor_from_cam.rotation,
                   floor_from_cam.translation + Eigen::Vector3d(way.x(), way.y(), 0)};
  const Pose step = moved.Inverse() * floor_from_cam;
  // A rotation of the left perturbation is about the camera's centre, and its translation moves that; what an
  // error of the heading does to later ways is in the transformation.
  told_ = TransformCovariance(step, told_);
  const Eigen::Matrix3d cam_from_floor = moved.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d up = cam_from_floor.col(2);
  const Eigen::Matrix3d planar = WheelCovariance({way, motion.turn_left_rad}, errors);
  told_.topLeftCorner<3, 3>() += planar(2, 2) * up * up.transpose();
  const Eigen::Matrix<double, 3, 2> cam_from_plane = cam_from_floor.leftCols<2>();
  told_.bottomRightCorner<3, 3>() +=
      cam_from_plane * planar.topLeftCorner<2, 2>() * cam_from_plane.transpose();
  now_ = step * now_;
  is_told_ = is_on_floor_ = true;
}

void MotionSinceFix::AddUnknown(const Pose& step, double sigma_m, double sigma_deg) {
  told_ = TransformCovariance(step, told_);
  now_ = step * now_;
  unknown_sigma_m_ += sigma_m;
  unknown_sigma_deg_ += sigma_deg;
}

UncertainPose MotionSinceFix::Predict(const WheelErrorOptions& errors) const {
  UncertainPose predicted{now_, told_};
  predicted.covariance += TransformCovariance(now_ * fix_.pose.Inverse(), fix_.covariance);
  const auto add = [&](double sigma_m, double sigma_deg) {
    const double sigma_rad = RadFromDeg(sigma_deg);
    predicted.covariance.diagonal().head<3>().array() += sigma_rad * sigma_rad;
    predicted.covariance.diagonal().tail<3>().array() += sigma_m * sigma_m;
  };
  add(unknown_sigma_m_, unknown_sigma_deg_);
  if (is_on_floor_) add(errors.wheel_way_sigma_m, errors.wheel_turn_sigma_deg);
  return predicted;
}

}  // namespace cairn
