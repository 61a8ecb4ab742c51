#pragma once

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"
#include "core/options/options.h"
#include "runtime/localize/localization.h"

namespace cairn {

struct MapHead;  // core/blocks/map_head.h

// A pose b_from_a and how well it is known: a camera's cam_from_world, or how one moved from a frame to the
// next, next_from_last, as an odometry in space (visual, inertial) says.
struct UncertainPose {
  Pose pose;
  // Rotation (rad), translation (the map's unit); of the left perturbation, as Localization has it.
  Matrix6d covariance = Matrix6d::Zero();
};
// Errors: InvalidArgument (not finite, no rotation, a matrix that is no covariance).
Status CheckUncertainPose(const UncertainPose& pose);

// How a camera moved over the floor: metres ahead and to the left, in its frame on the floor before, and a
// turn to the left, radians.
struct FloorMotion {
  Eigen::Vector2d way_m = Eigen::Vector2d::Zero();
  double turn_left_rad = 0;
};
// Whether odometry can move a camera in a map.  Errors: InvalidArgument (not finite), Unsupported (a map
// whose unit is not the metre).
Status CheckFloorMotion(const FloorMotion& motion, const MapHead& map);
// Where a mounted camera is on the floor, in its robot's frame, and to where it looks: to its image's top
// where it looks up or down.  What moves the robot moves the camera there.  The identity says that nobody
// stated where: above the middle of the axle, ahead.
PlanarPose CameraOnFloor(const Pose& robot_from_camera);
// What of a motion in space is over the floor, for a camera that looks about level.
FloorMotion OverFloor(const Pose& next_from_last);

// Errors of odometry over the floor, one standard deviation each.  Variances grow with all that a robot drove
// and turned, however often its wheels are read.
struct WheelErrorOptions {
  // Of each half metre of the way, as part of it: ahead, and a third of that beside; and in any case since
  // the last fix, up and down too, m.  REQUIRES: >= 0, > 0
  double wheel_way_ratio = 0.05;
  double wheel_way_sigma_m = 0.002;
  // Of each 20 degrees of turns, as part of them; and in any case, of the tilt too, degrees.  REQUIRES: >= 0,
  // > 0
  double wheel_turn_ratio = 0.05;
  double wheel_turn_sigma_deg = 0.05;
  // Of its heading, in each half metre of the way, however straight, degrees.  REQUIRES: >= 0
  double wheel_drift_deg = 0;
};
OptionTable DescribeOptions(WheelErrorOptions* options);
// Of a motion's way, in the frame of `way_m`, and of its turn: x, y (m), turn (rad), without what it errs in
// any case.
Eigen::Matrix3d WheelCovariance(const FloorMotion& motion, const WheelErrorOptions& errors);

// Where a camera is since it had a fix, by how it moved.
class MotionSinceFix {
 public:
  MotionSinceFix(const Pose& cam_from_world, const Matrix6d& covariance)
      : fix_{cam_from_world, covariance}, now_(cam_from_world) {}

  // REQUIRES: as CheckUncertainPose
  void Add(const UncertainPose& next_from_last);
  // Over the floor, in the frame that the camera has on it (FloorPoseOf).  REQUIRES: finite
  void Add(const FloorMotion& motion, const Pose& floor_from_world, const WheelErrorOptions& errors);
  // From one frame to the next, of which nothing is told: an expected step, and its standard deviations.
  void AddUnknown(const Pose& step, double sigma_m, double sigma_deg);

  const Pose& cam_from_world() const { return now_; }
  bool is_told() const { return is_told_; }
  // Standard deviations of the unknown steps, together: they add up, as steps that differ from what is
  // expected do so in one direction.
  double unknown_sigma_m() const { return unknown_sigma_m_; }
  double unknown_sigma_deg() const { return unknown_sigma_deg_; }
  UncertainPose Predict(const WheelErrorOptions& errors) const;

 private:
  UncertainPose fix_;
  Pose now_;
  Matrix6d told_ = Matrix6d::Zero();  // covariance of the motions
  bool is_told_ = false;
  bool is_on_floor_ = false;
  double unknown_sigma_m_ = 0, unknown_sigma_deg_ = 0;
};

}  // namespace cairn
