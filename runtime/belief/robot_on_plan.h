#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/planar_pose.h"
#include "core/options/options.h"
#include "core/plan/views.h"
#include "runtime/belief/image_places.h"
#include "runtime/belief/plan_tracker.h"
#include "runtime/scans/read_scans.h"

namespace cairn {

struct RobotOnPlanOptions {
  PlanTrackerOptions tracker;
  // How a scan is read: its largest range, and the segments that a search by these needs.
  ScanSegmentsOptions scan;
  // Where the laser stands on the robot: ahead and to the left of the middle of its axle, and turned to the
  // left.
  double laser_ahead_m = 0, laser_left_m = 0, laser_turn_deg = 0;
  // The same of the camera, of a robot with one.
  double camera_ahead_m = 0, camera_left_m = 0, camera_turn_deg = 0;
};
OptionTable DescribeOptions(RobotOnPlanOptions* options);

// Where a robot is in a floor plan, by what it has at hand: its wheels' poses, its laser's scans as ranges,
// what its camera's images say.  A PlanTracker of the laser, whose motions and places are the robot's.
// Deterministic.  Not for concurrent calls.
class RobotOnPlan {
 public:
  // Keeps the plan.  Errors: as PlanTracker::Make.
  static Result<RobotOnPlan> Make(std::shared_ptr<const Views> plan, const RobotOnPlanOptions& options = {});

  // How the robot moved, in its frame before; several add up.  Errors: InvalidArgument (not finite).
  Status Move(const FloorMotion& motion);
  // Where the wheels have it, in a frame of theirs: it moved as from the pose of the call before.  The first
  // one moves nothing.  Errors: InvalidArgument (not finite).
  Status MoveTo(const PlanarPose& wheels);
  // A scan in the laser's frame.  Errors: InvalidArgument (CheckRangeScan), NoData (too few beams met
  // something); the belief is then as before.
  Status SeeScan(const RangeScan& scan);
  // What an image says by itself, localized without a prior in the map whose head this is.  One that says
  // nothing of places changes nothing.  Errors: Unsupported (a map whose unit is not the metre).
  Status SeeImage(const Localization& found, const MapHead& head);
  // What another sense says by itself: places of the robot.  Errors: InvalidArgument (a number that is not
  // finite, a probability below 0, probabilities of more than 1 in all, a matrix that is no covariance).
  Status SeePlaces(std::span<const PossiblePlace> places);

  // Where the robot may be, the plan's frame; the most probable first.  With elsewhere() they sum to 1.
  std::vector<PossiblePlace> Places() const;
  double elsewhere() const { return tracker_.belief().elsewhere(); }

 private:
  RobotOnPlan(std::shared_ptr<const Views> plan, PlanTracker tracker, const RobotOnPlanOptions& options);

  std::shared_ptr<const Views> plan_;  // the tracker's
  PlanTracker tracker_;
  ScanSegmentsOptions scan_options_;
  PlanarPose robot_from_laser_, robot_from_camera_;
  std::optional<PlanarPose> wheels_;  // of the last MoveTo
};

}  // namespace cairn
