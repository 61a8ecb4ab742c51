#include "ros/plan_follower.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/blocks/map_head.h"
#include "runtime/beams/scan_locator.h"

namespace cairn_ros {

using namespace cairn;  // NOLINT: this file is the bridge

namespace {

// Places that are told.
constexpr double kLeastTold = 0.001;
constexpr size_t kMaxNumTold = 20;
// A laser that is tilted by more sees the floor and the ceiling.
constexpr double kMaxTiltDeg = 10;

double NowOr(double stamp_s) {
  if (stamp_s != 0) return stamp_s;
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Whether so many seconds have passed; a recording that is played again begins earlier.
bool IsOver(const std::optional<double>& last_s, double now_s, double period_s) {
  return !last_s || std::abs(now_s - *last_s) >= period_s;
}

}  // namespace

Result<PlanFollower> PlanFollower::Make(std::shared_ptr<const Map> map, const Pose& robot_from_camera,
                                        const Pose& robot_from_laser, double max_range_m, double period_s) {
  const double up = std::abs((robot_from_laser.rotation * Eigen::Vector3d::UnitZ()).z());
  if (!(up >= std::cos(RadFromDeg(kMaxTiltDeg))))
    return MakeError(
        ErrorCode::kInvalidArgument,
        "~laser_in_robot: the laser is tilted by {:.0f} degrees; a floor plan is seen by one that "
        "is level (or upside down) within {}",
        DegFromRad(std::acos(std::min(1.0, up))), kMaxTiltDeg);
  CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Views> plan, map->Plan());
  const PlanarPose camera = CameraOnFloor(robot_from_camera);
  // Beams are turned into the robot's axes.
  RobotOnPlanOptions options;
  options.scan.max_range_m = max_range_m;
  options.laser_ahead_m = robot_from_laser.translation.x();
  options.laser_left_m = robot_from_laser.translation.y();
  options.camera_ahead_m = camera.position.x();
  options.camera_left_m = camera.position.y();
  options.camera_turn_deg = DegFromRad(WrapAngle(camera.heading_rad));
  CAIRN_ASSIGN_OR_RETURN(RobotOnPlan robot, RobotOnPlan::Make(std::move(plan), options));
  return PlanFollower(std::move(map), robot_from_laser, period_s, std::move(robot));
}

PlanFollower::PlanFollower(std::shared_ptr<const Map> map, const Pose& robot_from_laser, double period_s,
                           RobotOnPlan robot)
    : map_(std::move(map)),
      robot_from_laser_(robot_from_laser.rotation.toRotationMatrix()),
      period_s_(period_s),
      unknown_(robot),
      robot_(std::move(robot)) {}

Status PlanFollower::AddOdometry(double time_s, const PlanarPose& odom_from_robot) {
  return odometry_.Add(time_s, odom_from_robot);
}

Result<bool> PlanFollower::MoveTo(double time_s) {
  const std::optional<FloorMotion> moved = odometry_.MoveTo(time_s);
  if (moved) {
    CAIRN_RETURN_IF_ERROR(robot_.Move(*moved));
    return true;
  }
  robot_ = unknown_;
  return false;
}

std::optional<PlanPlaces> PlanFollower::See(const LaserScan& scan) {
  const double now_s = NowOr(scan.stamp_s);
  const auto fail = [](const Error& error) { return PlanPlaces{.error = error.message}; };
  RangeScan given;
  given.first_angle_rad = scan.first_angle_rad;
  given.step_rad = scan.step_rad;
  given.max_range_m = scan.range_max_m;
  for (size_t i = 0; i < scan.num_ranges; ++i) {
    // REP 117: nearer than range_min is not measured.
    const double range = scan.ranges_m[i];
    given.ranges_m.push_back(range < scan.range_min_m ? std::numeric_limits<double>::quiet_NaN() : range);
  }
  if (const Status checked = CheckRangeScan(given); !checked.ok()) return fail(checked.error());
  std::vector<double> angles;
  for (size_t i = 0; i < scan.num_ranges; ++i) {
    const double angle = given.AngleOf(i);
    const Eigen::Vector3d direction =
        robot_from_laser_ * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    angles.push_back(std::atan2(direction.y(), direction.x()));
  }
  given.angles_rad = std::move(angles);
  const Result<bool> is_followed = MoveTo(scan.stamp_s);
  if (!is_followed.ok()) return fail(is_followed.error());
  last_scan_s_ = now_s;
  if (!*is_followed) {
    // To search everywhere takes long.
    if (!IsOver(last_anew_s_, now_s, period_s_)) return std::nullopt;
    last_anew_s_ = now_s;
  }
  const Status seen = robot_.SeeScan(given);
  if (!seen.ok() && seen.error().code != ErrorCode::kNoData) return fail(seen.error());
  PlanPlaces believed = Believed();
  if (!seen.ok()) believed.reason = seen.error().message;
  return believed;
}

bool PlanFollower::IsImageDue(double image_time_s) const {
  return last_scan_s_ && IsOver(last_image_s_, NowOr(image_time_s), period_s_);
}

PlanPlaces PlanFollower::SeeImage(const Localization& found, double image_time_s) {
  last_image_s_ = NowOr(image_time_s);
  const Result<bool> is_followed = MoveTo(image_time_s);
  if (!is_followed.ok()) return {.error = is_followed.error().message};
  if (const Status seen = robot_.SeeImage(found, map_->head()); !seen.ok())
    return {.error = seen.error().message};
  return Believed();
}

PlanPlaces PlanFollower::Believed() const {
  const Pose world_from_floor = map_->head().floor_from_world.Inverse();
  const Eigen::Matrix3d axes = world_from_floor.rotation.toRotationMatrix();
  // What x, y and heading move and turn in the map's frame.
  Eigen::Matrix<double, 6, 3> jacobian = Eigen::Matrix<double, 6, 3>::Zero();
  jacobian.topLeftCorner<3, 2>() = axes.leftCols<2>();
  jacobian.bottomRightCorner<3, 1>() = axes.col(2);
  PlanPlaces believed;
  believed.elsewhere = robot_.elsewhere();
  for (const PossiblePlace& place : robot_.Places()) {
    if (place.probability < kLeastTold || believed.places.size() == kMaxNumTold) break;
    const Pose floor_from_robot{
        Eigen::Quaterniond(Eigen::AngleAxisd(place.pose.heading_rad, Eigen::Vector3d::UnitZ())),
        {place.pose.position.x(), place.pose.position.y(), 0}};
    const Pose world_from_robot = world_from_floor * floor_from_robot;
    const Eigen::Matrix<double, 6, 6> covariance = jacobian * place.covariance * jacobian.transpose();
    PlanPlaces::Place& told = believed.places.emplace_back();
    std::copy_n(world_from_robot.translation.data(), 3, told.position);
    std::copy_n(world_from_robot.rotation.coeffs().data(), 4, told.orientation_xyzw);  // Eigen's order too
    for (int i = 0; i < 36; ++i) told.covariance[i] = covariance(i / 6, i % 6);
    told.probability = place.probability;
    told.is_determined = IsDetermined(place.covariance);
  }
  return believed;
}

}  // namespace cairn_ros
