#pragma once

#include <memory>
#include <optional>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"
#include "ros/map_localizer.h"
#include "ros/odometry.h"
#include "runtime/drive/place_belief.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/map.h"

namespace cairn_ros {

// Which places of a map a robot may be at, image after image, by its odometry where it has some
// (runtime/drive/place_belief.h).
class Whereabouts {
 public:
  // Errors: InvalidArgument (a period below 0), as PlaceBelief::Make.
  static cairn::Result<Whereabouts> Make(std::shared_ptr<const cairn::Map> map,
                                         const cairn::Pose& robot_from_camera, double period_s);

  // As Odometry::Add.  In a map whose unit is not the metre it does not count.
  cairn::Status AddOdometry(double time_s, const cairn::PlanarPose& odom_from_robot);
  // Whether the period since the last image is over; 0: now, by a clock of its own.
  bool IsDue(double image_time_s) const;
  // The next image, what it says by itself, and which way was up at it.
  Places See(const cairn::Query& query, const cairn::Localization& found, double image_time_s,
             const std::optional<cairn::SensedUp>& up);
  // As PlaceBelief has it.
  double ProbabilityAround(const cairn::Pose& cam_from_world) const {
    return belief_.ProbabilityAround(cam_from_world);
  }

 private:
  Whereabouts(std::shared_ptr<const cairn::Map> map, const cairn::Pose& robot_from_camera, double period_s,
              cairn::PlaceBelief belief)
      : map_(std::move(map)),
        robot_from_camera_(robot_from_camera),
        period_s_(period_s),
        belief_(std::move(belief)),
        odometry_(robot_from_camera) {}
  cairn::Result<Places> Update(const cairn::Query& query, const cairn::Localization& found,
                               double image_time_s, double seconds, const std::optional<cairn::SensedUp>& up);

  std::shared_ptr<const cairn::Map> map_;
  cairn::Pose robot_from_camera_;
  double period_s_;
  cairn::PlaceBelief belief_;
  cairn::Odometry odometry_;
  std::optional<double> last_image_s_;
};

}  // namespace cairn_ros
