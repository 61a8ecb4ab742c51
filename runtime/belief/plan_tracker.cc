#include "runtime/belief/plan_tracker.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "core/geometry/pose.h"
#include "core/plan/wall_cells.h"

namespace cairn {
namespace {

// Places of a belief from which the laser is looked for.
constexpr int kMaxNumExpected = 60;

// What wheels err by in any case.
UncertainPlanarPose StandingStill(const WheelErrorOptions& errors) {
  UncertainPlanarPose step;
  const double sigma_rad = RadFromDeg(errors.wheel_turn_sigma_deg);
  step.covariance.diagonal() << Eigen::Vector2d::Constant(errors.wheel_way_sigma_m *
                                                          errors.wheel_way_sigma_m),
      sigma_rad * sigma_rad;
  return step;
}

}  // namespace

OptionTable DescribeOptions(PlanTrackerOptions* o) {
  OptionTable table = {
      {.name = "min_way_m",
       .value = &o->min_way_m,
       .help =
           "a scan or an image counts after so much way since the last one that did, as the crow flies, m",
       .min = 0},
      {.name = "min_turn_deg",
       .value = &o->min_turn_deg,
       .help = "or after so much of a turn, degrees",
       .min = 0},
  };
  for (OptionTable more :
       {DescribeOptions(&o->belief), DescribeOptions(&o->wheels), DescribeOptions(&o->locator)})
    std::move(more.begin(), more.end(), std::back_inserter(table));
  return table;
}

PlanTracker::PlanTracker(ScanLocator locator, double area_m2, const PlanTrackerOptions& options)
    : locator_(std::move(locator)), options_(options), belief_(area_m2, options.belief) {}

Result<PlanTracker> PlanTracker::Make(const Views& views, const PlanTrackerOptions& options) {
  PlanTrackerOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_ASSIGN_OR_RETURN(ScanLocator locator, ScanLocator::Make(views, options.locator));
  return PlanTracker(std::move(locator), std::max(1.0, ExtentOf(views.plan.walls).prod()), options);
}

Status PlanTracker::Move(const FloorMotion& motion) {
  if (!motion.way_m.allFinite() || !std::isfinite(motion.turn_left_rad))
    return MakeError(ErrorCode::kInvalidArgument, "a motion that is not finite");
  const PlanarPose step{motion.way_m, motion.turn_left_rad};
  belief_.Move({step, WheelCovariance(motion, options_.wheels)});
  for (SinceLook* since : {&since_scan_, &since_image_}) since->now = since->now * step;
  return Ok();
}

bool PlanTracker::IsNew(const SinceLook& since) const {
  return !since.any || since.now.position.norm() >= options_.min_way_m ||
         std::abs(since.now.heading_rad) >= RadFromDeg(options_.min_turn_deg);
}

Status PlanTracker::SeeScan(const ScanView& scan) {
  std::vector<PlanarPose> expected;
  for (const PossiblePlace& place : belief_.places()) {
    if (std::ssize(expected) == kMaxNumExpected) break;
    expected.push_back(place.pose);
  }
  CAIRN_ASSIGN_OR_RETURN(const LocatedScan located, IsNew(since_scan_) ? locator_.Locate(scan, expected)
                                                                       : locator_.LocateNear(scan, expected));
  std::vector<PossiblePlace> places;
  for (const ScanHypothesis& found : located.hypotheses)
    places.push_back({{found.pose, found.covariance}, found.probability});
  See(places, &since_scan_);
  return Ok();
}

void PlanTracker::SeeImage(std::span<const PossiblePlace> places) {
  if (!places.empty()) See(places, &since_image_);
}

void PlanTracker::See(std::span<const PossiblePlace> places, SinceLook* since) {
  belief_.Move(StandingStill(options_.wheels));
  if (!IsNew(*since)) return belief_.Correct(places);
  belief_.Update(places);
  *since = {.any = true};
}

}  // namespace cairn
