#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"
#include "ros/map_localizer.h"
#include "ros/odometry.h"
#include "runtime/belief/robot_on_plan.h"
#include "runtime/localize/localization.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Where a robot is on its map's floor plan, by its laser, its odometry and what its images say
// (runtime/belief/robot_on_plan.h).
class PlanFollower {
 public:
  // Errors: InvalidArgument (a laser that is not level, a camera or laser farther than 10 m from the axle),
  // as RobotOnPlan::Make.
  static cairn::Result<PlanFollower> Make(std::shared_ptr<const cairn::Map> map,
                                          const cairn::Pose& robot_from_camera,
                                          const cairn::Pose& robot_from_laser, double max_range_m,
                                          double period_s);

  // As Odometry::Add.
  cairn::Status AddOdometry(double time_s, const cairn::PlanarPose& odom_from_robot);
  // The next scan.  Without odometry nothing is known of the way since the last: it begins anew, once in a
  // period.  None: it is not due.
  std::optional<PlanPlaces> See(const LaserScan& scan);
  // Whether the next image is to be localized by itself: there were scans, and the period since the last
  // image is over.
  bool IsImageDue(double image_time_s) const;
  // What an image says that was localized without a prior.
  PlanPlaces SeeImage(const cairn::Localization& found, double image_time_s);

 private:
  PlanFollower(std::shared_ptr<const cairn::Map> map, const cairn::Pose& robot_from_laser, double period_s,
               cairn::RobotOnPlan robot);
  // Moves what is believed to a time.  False: nothing is known of the way, and it began anew.
  cairn::Result<bool> MoveTo(double time_s);
  // In the map's frame.
  PlanPlaces Believed() const;

  std::shared_ptr<const cairn::Map> map_;
  Eigen::Matrix3d robot_from_laser_;  // rotation
  double period_s_;
  cairn::RobotOnPlan unknown_;  // of a robot that may be anywhere
  cairn::RobotOnPlan robot_;
  cairn::Odometry odometry_{cairn::Pose()};  // of the robot itself
  std::optional<double> last_anew_s_, last_scan_s_, last_image_s_;
};

}  // namespace cairn_ros
