#include "ros/robot_pose.h"

namespace cairn {
namespace {

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

}  // namespace

RobotPose RobotPoseOf(const Localization& fix, const Pose& robot_from_camera) {
  const Pose world_from_cam = fix.cam_from_world.Inverse();
  const Pose world_from_robot = world_from_cam * robot_from_camera.Inverse();
  // d (place, rotation) / d (r, t); a turn by w moves the robot's origin by w x q = -[q] w.
  const Eigen::Matrix3d rotation = world_from_cam.rotation.toRotationMatrix();
  const Eigen::Vector3d q = world_from_robot.translation - world_from_cam.translation;
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = CrossMatrix(q) * rotation;
  jacobian.topRightCorner<3, 3>() = -rotation;
  jacobian.bottomLeftCorner<3, 3>() = -rotation;
  return {world_from_robot.translation, world_from_robot.rotation,
          jacobian * fix.covariance * jacobian.transpose()};
}

}  // namespace cairn
