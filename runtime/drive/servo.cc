#include "runtime/drive/servo.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/geometry/pose.h"

namespace cairn {
namespace {

// A retreat covers at least this part of the scene's distance per second at speed_gain 1: during a retreat
// the distance to the target does not say how far to go.
constexpr double kRetreatRatio = 0.15;
// Directions up to this part of max_heading_deg are approached without a retreat.
constexpr double kApproachable = 0.8;
// On the way to the height of the target a robot ends this part of a retreat behind it.
constexpr double kHeightOfTarget = 0.1;
// Distance that the robot goes away from what stopped it, over the scene's distance.
constexpr double kAwayRatio = 0.2;
// Commands are counted against the patience once the robot has come within this many tolerances.
constexpr double kNearRatio = 5;
// Tolerances are doubled at most this often.
constexpr int kMostDoublings = 3;
// Weight of what earlier commands taught, per further command; weight of the first guess, as a squared ratio.
constexpr double kForget = 0.9;
constexpr double kGuessWeight = 2e-4;

// The information of one image about the focal length counts as this part of what it would be with
// independent noise, and all images together leave this standard deviation.
constexpr double kFocalShare = 0.2;
constexpr double kLeastFocalError = 0.02;

double Limited(double value, double limit) { return std::clamp(value, -limit, limit); }
double Sign(double value) { return value < 0 ? -1 : 1; }

}  // namespace

OptionTable DescribeOptions(ServoOptions* o) {
  return {
      {"max_speed_m_s", &o->max_speed_m_s, "greatest speed, m/s", 1e-3, 10},
      {"max_turn_deg_s", &o->max_turn_deg_s, "greatest turn rate, degrees/s", 0.1, 720},
      {"step_s", &o->step_s, "time for which a command holds, seconds", 1e-3, 10},
      {"speed_gain", &o->speed_gain, "part of the remaining way that is covered in a second", 1e-3, 10},
      {"turn_gain", &o->turn_gain, "part of the wanted turn that is made in a second", 1e-3, 10},
      {"approach_gain", &o->approach_gain, "heading over the direction to the target while it approaches",
       1.5, 10},
      {"max_heading_deg", &o->max_heading_deg, "greatest deliberate turn from the target's heading, degrees",
       5, 60},
      {"max_heading_error_deg", &o->max_heading_error_deg,
       "turns on the spot when the heading is off by more, degrees", 1, 90},
      {"arrive_heading_deg", &o->arrive_heading_deg,
       "arrived: largest turn from the target's heading, degrees", 1e-3, 45},
      {"arrive_distance_ratio", &o->arrive_distance_ratio,
       "arrived: largest distance from the target over that of the scene", 1e-4, 1},
      {"patience_commands", &o->patience_commands,
       "tolerances of arrival double every time this many commands were given near the target", 1},
      {"max_retreat_ratio", &o->max_retreat_ratio,
       "a retreat ends at this distance behind the target, over that of the scene", 1e-3, 10},
      {"min_num_matches_to_turn", &o->min_num_matches_to_turn,
       "with fewer matches the robot looks along the target's heading, the fewer the straighter", 4},
      {"scene_distance_m", &o->scene_distance_m, "distance of the scene before anything is known, metres",
       0.01, 1000},
      {"camera_ahead_m", &o->camera_ahead_m, "the camera's place ahead of the middle of the axle, metres", -2,
       2},
      {"camera_left_m", &o->camera_left_m, "the camera's place to the left of it, metres", -2, 2},
      {"camera_turn_deg", &o->camera_turn_deg, "how far the camera is turned to the left, degrees", -45, 45},
  };
}

const char* ServoStateName(ServoState state) {
  switch (state) {
    case ServoState::kTurning:
      return "turning";
    case ServoState::kApproaching:
      return "approaching";
    case ServoState::kArrived:
      return "arrived";
    case ServoState::kLost:
      break;
  }
  return "lost";
}

PolarRates RatesOf(double rho_m, double psi_rad, double speed_m_s, double turn_rad_s) {
  // [Mariottini11 §V-A] by its reference: the unicycle in polar coordinates (servo.h)
  const double swing = speed_m_s / rho_m * std::sin(psi_rad);
  return {-speed_m_s * std::cos(psi_rad), swing - turn_rad_s, swing};
}

Servo::Servo(const Camera& camera, const ServoOptions& options)
    : camera_(camera),
      options_(options),
      way_m_(kGuessWeight * options.scene_distance_m),
      way_ratio_(kGuessWeight) {}

Result<Servo> Servo::Create(const Camera& assumed_camera, const ServoOptions& options) {
  CAIRN_RETURN_IF_ERROR(CheckCamera(assumed_camera));
  ServoOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked.epipoles)));
  return Servo(assumed_camera, options);
}

// Information filter: the image adds the estimate's information less the prior's.
void Servo::LearnFocal(const PlanarEpipoles& epipoles) {
  PlanarEpipolesOptions& known = options_.epipoles;
  const double before = 1 / (known.focal_error_ratio * known.focal_error_ratio);
  const double after = 1 / (epipoles.focal_error_ratio * epipoles.focal_error_ratio);
  if (!(after > before * (1 + 1e-9))) return;
  const double offset = std::log(epipoles.focal_ratio / known.focal_ratio) * after / (after - before);
  const double added = kFocalShare * (after - before);
  known.focal_ratio = std::clamp(known.focal_ratio * std::exp(offset * added / (before + added)), 0.5, 2.0);
  known.focal_error_ratio = std::max(kLeastFocalError, 1 / std::sqrt(before + added));
}

bool Servo::IsCameraOnAxle() const {
  return options_.camera_ahead_m == 0 && options_.camera_left_m == 0 && options_.camera_turn_deg == 0;
}

PlanarPose Servo::AxleInTarget(const PlanarEpipoles& epipoles) const {
  PlanarPose pose = epipoles.PoseInTarget();
  if (IsCameraOnAxle()) return pose;
  const Eigen::Vector2d camera =
      Eigen::Vector2d(options_.camera_ahead_m, options_.camera_left_m) / scene_distance_m();
  const Eigen::Rotation2Dd turn(RadFromDeg(options_.camera_turn_deg));
  pose.position = turn * pose.position + camera - Eigen::Rotation2Dd(pose.heading_rad) * camera;
  return pose;
}

// The last command should have moved the camera by a known way: with the robot along its heading, and about
// the middle of its axle as it turned.
void Servo::LearnScale(const PlanarPose& pose) {
  if (!last_ || last_speed_m_s_ == 0) return;
  const PlanarPose before = last_->PoseInTarget();
  const double half_turn = 0.5 * WrapAngle(pose.heading_rad - before.heading_rad);
  const Eigen::Rotation2Dd along(before.heading_rad + half_turn);
  const Eigen::Vector2d camera_m(options_.camera_ahead_m, options_.camera_left_m);
  const Eigen::Vector2d way_m =
      along * (Eigen::Vector2d(last_speed_m_s_ * options_.step_s, 0) +
               Eigen::Rotation2Dd(half_turn) * camera_m - Eigen::Rotation2Dd(-half_turn) * camera_m);
  // The target's camera is turned on the robot, too.
  const Eigen::Vector2d ratio =
      Eigen::Rotation2Dd(RadFromDeg(options_.camera_turn_deg)) * (pose.position - before.position);
  const double along_way = ratio.dot(way_m.normalized());
  if (!(along_way > 0)) return;  // noise
  way_m_ = kForget * way_m_ + way_m.norm() * along_way;
  way_ratio_ = kForget * way_ratio_ + along_way * along_way;
}

double Servo::Patience() const {
  return std::ldexp(1.0, std::min(num_commands_ / options_.patience_commands, kMostDoublings));
}

void Servo::Blocked() {
  if (!last_ || last_speed_m_s_ == 0) return;
  const PlanarPose pose = AxleInTarget(*last_);
  leg_ = last_speed_m_s_ > 0 ? Leg::kRetreat : Leg::kToHeightOfTarget;
  leg_side_ = Sign(pose.position.y());
  blocked_at_ = pose.position;
  last_speed_m_s_ = 0;
}

void Servo::ChooseLeg(const PlanarPose& pose) {
  if (blocked_at_ && (pose.position - *blocked_at_).norm() < kAwayRatio) return;
  blocked_at_.reset();
  const double behind = -pose.position.x(), beside = std::abs(pose.position.y());
  const double max_heading = RadFromDeg(options_.max_heading_deg);
  const double direction = std::atan2(beside, std::abs(behind));  // |delta|, or of the mirrored way backwards
  const bool in_cone = direction <= max_heading / options_.approach_gain;
  const bool on_axis = beside <= options_.arrive_distance_ratio * Patience();
  const Leg before = leg_;
  switch (leg_) {
    case Leg::kApproach:
      if (!on_axis && direction > kApproachable * max_heading) {
        leg_ = behind < options_.max_retreat_ratio ? Leg::kRetreat : Leg::kToHeightOfTarget;
      }
      break;
    case Leg::kRetreat:
      if (in_cone) {
        leg_ = Leg::kApproach;
      } else if (behind >= options_.max_retreat_ratio) {
        leg_ = direction > kApproachable * max_heading ? Leg::kToHeightOfTarget : Leg::kApproach;
      }
      break;
    case Leg::kToHeightOfTarget:
      if (in_cone) {
        leg_ = Leg::kApproach;
      } else if (behind <= kHeightOfTarget * options_.max_retreat_ratio) {
        leg_ = on_axis ? Leg::kApproach : Leg::kRetreat;
      }
  }
  if (leg_ != before) leg_side_ = Sign(pose.position.y());
}

double Servo::WantedHeading(const PlanarPose& pose, int num_inliers) const {
  const double least = options_.epipoles.min_num_inliers;
  const double share = (num_inliers - least) / std::max(1.0, options_.min_num_matches_to_turn - least);
  const double limit = RadFromDeg(options_.max_heading_deg) * std::clamp(share, 0.0, 1.0);
  const double behind = -pose.position.x(), left = pose.position.y();
  if (leg_ == Leg::kRetreat) return leg_side_ * limit;
  if (leg_ == Leg::kToHeightOfTarget) return -leg_side_ * limit;
  const double tolerance = options_.arrive_distance_ratio * Patience();
  if (std::abs(behind) <= tolerance) return 0;
  // The direction to the target, less its uncertainty near the target.
  const double offset = Sign(left) * std::max(0.0, std::abs(left) - 0.5 * tolerance);
  const double delta = std::atan2(-offset, std::max(std::abs(behind), 3 * tolerance));
  // [Mariottini11 §V-A] both epipoles to zero and then along the axis, in one: by the heading (servo.h)
  return Limited(Sign(behind) * options_.approach_gain * delta, limit);
}

ServoCommand Servo::Step(const std::vector<PixelPair>& pairs) {
  ServoCommand command{.num_matches = static_cast<int>(pairs.size())};
  std::vector<RayPair> rays;
  for (const PixelPair& pair : pairs) {
    if (!pair.current_px.allFinite() || !pair.target_px.allFinite()) continue;
    const auto current = CameraFromImage(camera_, pair.current_px);
    const auto target = CameraFromImage(camera_, pair.target_px);
    if (current && target) rays.push_back({*current, *target});
  }
  Result<PlanarEpipoles> epipoles =
      EstimatePlanarEpipoles(rays, camera_.MeanFocal(), options_.epipoles, last_ ? &*last_ : nullptr);
  if (!epipoles.ok()) {
    command.why = epipoles.error().message;
    last_.reset();
    last_speed_m_s_ = 0;
    return command;
  }
  command.epipoles = *epipoles;
  LearnScale(epipoles->PoseInTarget());
  LearnFocal(*epipoles);
  last_ = std::move(*epipoles);
  last_speed_m_s_ = 0;

  const PlanarPose pose = AxleInTarget(*last_);
  const double distance = IsCameraOnAxle() ? last_->distance_ratio : pose.position.norm();
  const bool is_there = distance <= options_.arrive_distance_ratio * Patience();
  const double max_turn = RadFromDeg(options_.arrive_heading_deg) * Patience();
  num_commands_ += num_commands_ > 0 || distance <= kNearRatio * options_.arrive_distance_ratio;
  if (is_there && std::abs(pose.heading_rad) <= max_turn) {
    command.state = ServoState::kArrived;
    command.why = fmt::format("{:.2f} degrees and {:.4f} of the scene's distance from the target",
                              DegFromRad(pose.heading_rad), distance);
    return command;
  }
  if (!is_there) ChooseLeg(pose);
  const double wanted = is_there ? 0 : WantedHeading(pose, last_->num_inliers);
  const double error = WrapAngle(wanted - pose.heading_rad);
  command.turn_rad_s = Limited(options_.turn_gain * error, RadFromDeg(options_.max_turn_deg_s));
  const double aligned = 1 - std::abs(error) / RadFromDeg(options_.max_heading_error_deg);
  if (!is_there && aligned > 0) {
    const double way =
        leg_ == Leg::kApproach ? std::abs(pose.position.x()) : std::max(kRetreatRatio, distance);
    const bool backwards = leg_ == Leg::kRetreat || (leg_ == Leg::kApproach && pose.position.x() > 0);
    const double speed = Limited(options_.speed_gain * way * scene_distance_m(), options_.max_speed_m_s);
    command.speed_m_s = (backwards ? -1 : 1) * speed * aligned;
  }
  last_speed_m_s_ = command.speed_m_s;
  command.state = command.speed_m_s == 0 ? ServoState::kTurning : ServoState::kApproaching;
  command.why = fmt::format("{}: turn {:.1f} degrees, wanted {:.1f}; {:.3f} of the scene's distance to go",
                            is_there                 ? "is there"
                            : leg_ == Leg::kApproach ? "comes in"
                            : leg_ == Leg::kRetreat  ? "retreats to come in along the axis"
                                                     : "goes to the height of the target",
                            DegFromRad(pose.heading_rad), DegFromRad(wanted), distance);
  return command;
}

}  // namespace cairn
