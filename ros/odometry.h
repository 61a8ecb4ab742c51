#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"
#include "runtime/track/camera_motion.h"

namespace cairn {

// Where odometry has a robot, and how its camera moved from image to image.
class Odometry {
 public:
  explicit Odometry(const Pose& robot_from_camera) : robot_from_camera_(CameraOnFloor(robot_from_camera)) {}

  // A pose of odometry's own frame, at a time.  One that is earlier than the one before begins anew: a
  // recording is played again.  Errors: InvalidArgument (not finite).
  Status Add(double time_s, const PlanarPose& odom_from_robot);
  // Since the image of the call before; nothing where either has no odometry.  Between two poses on the
  // straight way from one to the other; after the last one: there.  Time 0: now.
  std::optional<FloorMotion> MoveTo(double image_time_s);

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
