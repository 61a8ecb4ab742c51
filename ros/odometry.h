#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"

namespace cairn {

// Where a mounted camera is on the floor, in its robot's frame, and to where it looks: along its optical
// axis, z; one that looks up or down has the robot's heading.
PlanarPose CameraOnFloor(const Pose& robot_from_camera);

// How a camera moved over the floor, in its frame at the beginning.
struct CameraMove {
  Eigen::Vector2d way_m = Eigen::Vector2d::Zero();  // ahead, to the left
  double turn_left_rad = 0;
};

// Where odometry has a robot, and how its camera moved from image to image.
class Odometry {
 public:
  explicit Odometry(const Pose& robot_from_camera) : robot_from_camera_(CameraOnFloor(robot_from_camera)) {}

  // A pose of odometry's own frame, at a time.  One that is earlier than the one before begins anew: a
  // recording is played again.  Errors: InvalidArgument (not finite).
  Status Add(double time_s, const PlanarPose& odom_from_robot);
  // Since the image of the call before; nothing where either has no odometry.  Between two poses on the
  // straight way from one to the other; after the last one: there.  Time 0: now.
  std::optional<CameraMove> MoveTo(double image_time_s);

 private:
  struct TimedPose {
    double time_s;
    PlanarPose odom_from_robot;
  };
  std::optional<PlanarPose> At(double time_s) const;

  PlanarPose robot_from_camera_;
  std::deque<TimedPose> poses_;
  std::optional<PlanarPose> last_;  // of the camera, at the last image
};

}  // namespace cairn
