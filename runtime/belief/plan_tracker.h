#pragma once

#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/belief/pose_belief.h"
#include "runtime/track/camera_motion.h"

namespace cairn {

struct PlanTrackerOptions {
  // A place that a scan makes less probable than others by this is still looked at, as the next scans, or an
  // image, may say otherwise.
  ScanLocatorOptions locator{.least_odds = 1e-6};
  WheelErrorOptions wheels{.wheel_way_ratio = 0.15,
                           .wheel_way_sigma_m = 0.02,
                           .wheel_turn_ratio = 0.15,
                           .wheel_turn_sigma_deg = 1,
                           .wheel_drift_deg = 2};
  PoseBeliefOptions belief;
  // A scan, or an image, counts where the robot moved or turned so far since the last one that did; nearer
  // ones say the same again, their errors included, and tell only where at its places it is.  REQUIRES: >= 0
  double min_way_m = 0.3;
  double min_turn_deg = 15;
};
OptionTable DescribeOptions(PlanTrackerOptions* options);

// Finds where a robot is in a floor plan, and follows it: from anywhere, by a laser's scans, a camera's
// images and its wheels, any of them.  Several places may explain what it saw so far; what it sees next
// selects among them.  A place that was sure is given up where what is seen there keeps speaking against it:
// a kidnapped robot is found again.  Deterministic.  Not for concurrent calls.
class PlanTracker {
 public:
  // `views` outlives this; only their plan's walls are read, unless scans are located by segments.
  // Errors: InvalidArgument (options), and those of ScanLocator::Make.
  static Result<PlanTracker> Make(const Views& views, const PlanTrackerOptions& options = {});

  // How the robot moved over the floor, as its wheels say; several add up.  Errors: InvalidArgument (not
  // finite).
  Status Move(const FloorMotion& motion);
  // A scan, in the robot's frame.  Errors: as ScanLocator::Locate; the belief is then as before.
  Status SeeScan(const ScanView& scan);
  // Where an image says that the robot is (image_places.h), localized without a prior: one from what was seen
  // before would count that twice.
  void SeeImage(std::span<const PossiblePlace> places);

  // Where it is now: the robot's frame in the plan's, the most probable place first.
  const PoseBelief& belief() const { return belief_; }

 private:
  // The last look of a sense that counted, and where the robot is since, in its frame there.
  struct SinceLook {
    bool any = false;
    PlanarPose now;
  };
  PlanTracker(ScanLocator locator, double area_m2, const PlanTrackerOptions& options);
  bool IsNew(const SinceLook& since) const;
  void See(std::span<const PossiblePlace> places, SinceLook* since);

  ScanLocator locator_;
  PlanTrackerOptions options_;
  PoseBelief belief_;
  SinceLook since_scan_, since_image_;
};

}  // namespace cairn
