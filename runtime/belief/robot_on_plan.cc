#include "runtime/belief/robot_on_plan.h"

#include <cmath>
#include <iterator>
#include <utility>

#include <Eigen/Eigenvalues>

#include "core/blocks/map_head.h"
#include "core/geometry/pose.h"

namespace cairn {
namespace {

PlanarPose Mounting(double ahead_m, double left_m, double turn_deg) {
  return {{ahead_m, left_m}, RadFromDeg(turn_deg)};
}

// Errors: InvalidArgument.
Status CheckPossible(const PossiblePlace& place, size_t number) {
  if (!place.pose.position.allFinite() || !std::isfinite(place.pose.heading_rad) ||
      !place.covariance.allFinite())
    return MakeError(ErrorCode::kInvalidArgument, "place {} has a number that is not finite", number);
  if (!(place.probability >= 0 && place.probability <= 1))
    return MakeError(ErrorCode::kInvalidArgument, "place {} has a probability of {}; expected 0 to 1", number,
                     place.probability);
  const double scale = place.covariance.cwiseAbs().maxCoeff();
  const bool is_symmetric =
      (place.covariance - place.covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * scale;
  const Eigen::Vector3d variances =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(place.covariance, Eigen::EigenvaluesOnly).eigenvalues();
  if (!is_symmetric || !(variances[0] > 0))
    return MakeError(ErrorCode::kInvalidArgument,
                     "place {}: the matrix is no covariance of x, y and heading: {}", number,
                     is_symmetric ? "some direction has no variance" : "it is not symmetric");
  return Ok();
}

}  // namespace

OptionTable DescribeOptions(RobotOnPlanOptions* o) {
  constexpr double kFarthestM = 10;
  OptionTable table = DescribeOptions(&o->tracker);
  for (Option& option : DescribeOptions(&o->scan)) table.push_back(std::move(option));
  const auto add = [&](const char* name, double* value, const char* help, double most) {
    table.push_back({.name = name, .value = value, .help = help, .min = -most, .max = most});
  };
  add("laser_ahead_m", &o->laser_ahead_m, "the laser's place ahead of the middle of the axle, metres",
      kFarthestM);
  add("laser_left_m", &o->laser_left_m, "the laser's place to the left of it, metres", kFarthestM);
  add("laser_turn_deg", &o->laser_turn_deg, "how far the laser is turned to the left, degrees", 180);
  add("camera_ahead_m", &o->camera_ahead_m, "the camera's place ahead of the middle of the axle, metres",
      kFarthestM);
  add("camera_left_m", &o->camera_left_m, "the camera's place to the left of it, metres", kFarthestM);
  add("camera_turn_deg", &o->camera_turn_deg, "how far the camera is turned to the left, degrees", 180);
  return table;
}

RobotOnPlan::RobotOnPlan(std::shared_ptr<const Views> plan, PlanTracker tracker,
                         const RobotOnPlanOptions& options)
    : plan_(std::move(plan)),
      tracker_(std::move(tracker)),
      scan_options_(options.scan),
      robot_from_laser_(Mounting(options.laser_ahead_m, options.laser_left_m, options.laser_turn_deg)),
      robot_from_camera_(Mounting(options.camera_ahead_m, options.camera_left_m, options.camera_turn_deg)) {}

Result<RobotOnPlan> RobotOnPlan::Make(std::shared_ptr<const Views> plan, const RobotOnPlanOptions& options) {
  RobotOnPlanOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_ASSIGN_OR_RETURN(PlanTracker tracker, PlanTracker::Make(*plan, options.tracker));
  return RobotOnPlan(std::move(plan), std::move(tracker), options);
}

Status RobotOnPlan::Move(const FloorMotion& motion) {
  // The laser is carried around the axle: (robot_from_laser)^-1 (motion) (robot_from_laser).
  const Eigen::Vector2d& arm = robot_from_laser_.position;
  const Eigen::Vector2d way = motion.way_m + (Eigen::Rotation2Dd(motion.turn_left_rad) * arm - arm);
  return tracker_.Move({Eigen::Rotation2Dd(-robot_from_laser_.heading_rad) * way, motion.turn_left_rad});
}

Status RobotOnPlan::MoveTo(const PlanarPose& wheels) {
  if (!wheels.position.allFinite() || !std::isfinite(wheels.heading_rad))
    return MakeError(ErrorCode::kInvalidArgument, "a pose of the wheels that is not finite");
  if (wheels_) {
    const PlanarPose moved = MotionBetween(*wheels_, wheels);
    CAIRN_RETURN_IF_ERROR(Move({moved.position, moved.heading_rad}));
  }
  wheels_ = wheels;
  return Ok();
}

Status RobotOnPlan::SeeScan(const RangeScan& scan) {
  CAIRN_RETURN_IF_ERROR(CheckRangeScan(scan));
  return tracker_.SeeScan(ViewOf(scan, scan_options_));
}

Status RobotOnPlan::SeeImage(const Localization& found, const MapHead& head) {
  if (!IsMetric(head.frame)) {
    return MakeError(ErrorCode::kUnsupported,
                     "images are localized in a map whose unit is not the metre, and plans have metres");
  }
  tracker_.SeeImage(PlacesOf(found, head, MotionBetween(robot_from_camera_, robot_from_laser_)));
  return Ok();
}

Status RobotOnPlan::SeePlaces(std::span<const PossiblePlace> places) {
  std::vector<PossiblePlace> of_laser;
  double sum = 0;
  for (const PossiblePlace& place : places) {
    CAIRN_RETURN_IF_ERROR(CheckPossible(place, of_laser.size()));
    sum += place.probability;
    of_laser.push_back({place * robot_from_laser_, place.probability});
  }
  if (sum > 1 + 1e-6)
    return MakeError(ErrorCode::kInvalidArgument, "the probabilities of places sum to {}; expected at most 1",
                     sum);
  tracker_.SeeImage(of_laser);
  return Ok();
}

std::vector<PossiblePlace> RobotOnPlan::Places() const {
  const PlanarPose laser_from_robot = MotionBetween(robot_from_laser_, {});
  std::vector<PossiblePlace> places;
  for (const PossiblePlace& place : tracker_.belief().places())
    places.push_back({place * laser_from_robot, place.probability});
  return places;
}

}  // namespace cairn
