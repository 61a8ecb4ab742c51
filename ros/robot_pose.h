#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "runtime/localize/localizer.h"

namespace cairn {

// A robot's pose in the map frame, with the conventions of geometry_msgs/PoseWithCovariance.
struct RobotPose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // metres
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Matrix6d covariance = Matrix6d::Zero();  // x, y, z (m), rotation about the map's fixed x, y, z (rad)
};

// From a fix.  A map gives poses of cameras: without a mounting (`robot_from_camera` = identity) it is the
// pose of the camera's optical frame, x right, y down, z forward.
//
// Our covariance is (rotation r, translation t) of the left perturbation of cam_from_world.  With W =
// world_from_cam, of rotation R, to first order
//   W' = W (Exp(r), t)^-1:  rotation' = Exp(-R r) R,  place' = place - R t
// and the robot's origin, q away from the camera in map axes, moves by -R t + (-R r) x q.
// REQUIRES: fix.has_fix()
RobotPose RobotPoseOf(const Localization& fix, const Pose& robot_from_camera);

}  // namespace cairn
