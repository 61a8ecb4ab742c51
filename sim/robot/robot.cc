#include "sim/robot/robot.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/random.h"
#include "core/blocks/map_rows.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/pose.h"
#include "sim/survey/survey.h"

namespace cairn::sim {
namespace {

// Turns on the spot, degrees from where it lost the target, in order.
constexpr double kSearchDeg[] = {20, -20, 40, -40, 60, -60};
// Number of blocked commands on the way to one image after which the robot gives up.
constexpr int kMaxNumBlocked = 8;

}  // namespace

OptionTable DescribeOptions(RobotOptions* o) {
  OptionTable table = {
      {.name = "servo",
       .value = &o->servo,
       .help = "how the robot gets to an image: steered by the image, or put there with noise",
       .choices = {"epipolar", "ideal"}},
      {"ideal_noise_m", &o->ideal_noise_m, "standard deviation of the ideal servo's place, per axis, metres",
       0, 1},
      {"ideal_noise_deg", &o->ideal_noise_deg, "standard deviation of the ideal servo's heading, degrees", 0,
       45},
      {"ideal_reach_m", &o->ideal_reach_m, "the ideal servo reaches places no farther than this, metres",
       0.01, 1000},
      {"focal_ratio", &o->focal_ratio, "focal length that the servo assumes over the camera's", 0.5, 2},
      {"radius_m", &o->radius_m, "radius of the robot, metres", 0, 2},
      {"max_num_commands", &o->max_num_commands, "most commands to one image", 1},
  };
  for (const OptionTable& part :
       {DescribeOptions(&o->pass), DescribeOptions(&o->sensors), DescribeOptions(&o->sift)}) {
    table.insert(table.end(), part.begin(), part.end());
  }
  return table;
}

PlanarPose PlanarPoseOf(const Pose& cam_from_world) {
  const FloorPose pose = FloorPoseOf(cam_from_world, Pose());
  return {pose.position, WrapAngle(RadFromDeg(pose.heading_deg))};
}

Result<RobotTarget> RobotTargetOf(const Map& map, int32_t image_idx) {
  CAIRN_ASSIGN_OR_RETURN(ServoTarget target, TargetOfImage(map, image_idx));
  CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(image_idx));
  return RobotTarget{std::move(target), PlanarPoseOf(image->cam_from_world)};
}

Robot::Robot(const Building& building, const Camera& camera, double camera_height_m,
             const RobotOptions& options, const ServoOptions& servo_options, uint64_t seed)
    : building_(&building),
      renderer_(building, camera),
      camera_height_m_(camera_height_m),
      options_(options),
      servo_options_(servo_options),
      seed_(seed) {}

Result<Robot> Robot::Create(const Building& building, const Camera& camera, double camera_height_m,
                            const RobotOptions& options, const ServoOptions& servo_options, uint64_t seed) {
  RobotOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_ASSIGN_OR_RETURN([[maybe_unused]] const Servo servo, Servo::Create(camera, servo_options));
  return Robot(building, camera, camera_height_m, options, servo_options, seed);
}

Features Robot::Look() {
  const uint64_t seed = MixSeed(seed_, num_draws_++);
  const PlannedImage image = ExposeImage(pose_, motion_, camera_height_m_, options_.sensors, seed);
  const cv::Mat grey = TakeImage(renderer_, image, seed);
  return *ExtractSift(grey, options_.sift);  // fails for bad options only, which Create has checked
}

Camera Robot::AssumedCamera() const {
  Camera assumed = renderer_.camera();
  const int num_focals = assumed.model == CameraModel::kPinhole ? 2 : 1;
  for (int i = 0; i < num_focals; ++i) assumed.params[i] *= options_.focal_ratio;
  return assumed;
}

int Robot::NumAgreeing(const Features& seen, const ServoTarget& target) const {
  return cairn::NumAgreeing(seen, target, AssumedCamera(), servo_options_);
}

RobotLeg Robot::GoTo(const RobotTarget& target, bool is_goal) {
  return options_.servo == "ideal" ? GoIdeally(target) : Steer(target.target, is_goal);
}

RobotLeg Robot::GoIdeally(const RobotTarget& target) {
  std::vector<PlanarPose> alike = {target.pose};
  if (building_->layout.twins) {
    const Twins& twins = *building_->layout.twins;
    for (const double offset : {twins.offset_m, -twins.offset_m}) {
      const double x = target.pose.position.x() + std::min(offset, 0.0);  // in the first twin
      if (x < twins.rect.x0 || x > twins.rect.x1) continue;
      alike.push_back({target.pose.position + Eigen::Vector2d(offset, 0), target.pose.heading_rad});
    }
  }
  // It moves by the difference between the places of the last image and this one.
  Eigen::Vector2d expected = pose_.position;
  if (last_target_) expected += target.pose.position - last_target_->position;
  const PlanarPose& nearest =
      *std::min_element(alike.begin(), alike.end(), [&](const PlanarPose& a, const PlanarPose& b) {
        return (a.position - expected).norm() < (b.position - expected).norm();
      });
  RobotLeg leg;
  leg.steps.push_back({.pose = pose_});
  if ((nearest.position - pose_.position).norm() > options_.ideal_reach_m) {
    leg.why = fmt::format("nothing that looks like the image within {:g} m", options_.ideal_reach_m);
    return leg;
  }
  Random random(MixSeed(seed_, num_draws_++));
  const double x = random.Normal(0, options_.ideal_noise_m), y = random.Normal(0, options_.ideal_noise_m);
  const double turn = RadFromDeg(random.Normal(0, options_.ideal_noise_deg));
  const PlanarPose noisy = {nearest.position + Eigen::Vector2d(x, y), WrapAngle(nearest.heading_rad + turn)};
  pose_ = ClearanceM(*building_, noisy.position.x(), noisy.position.y()) > 0 ? noisy : nearest;
  leg.arrived = true;
  last_target_ = target.pose;
  leg.why = "put there";
  leg.steps.back().command.state = ServoState::kArrived;
  return leg;
}

PlanarPose Robot::Mounting() const {
  return {{servo_options_.camera_ahead_m, servo_options_.camera_left_m},
          RadFromDeg(servo_options_.camera_turn_deg)};
}

PlanarPose Robot::Axle() const {
  PlanarPose axle;
  axle.heading_rad = WrapAngle(pose_.heading_rad - Mounting().heading_rad);
  axle.position = pose_.position - Eigen::Rotation2Dd(axle.heading_rad) * Mounting().position;
  return axle;
}

void Robot::PutAxleAt(const PlanarPose& axle) { pose_ = axle * Mounting(); }

// False where a wall stops it.
bool Robot::Move(const ServoCommand& command) {
  const double seconds = servo_options_.step_s;
  motion_ =
      SlippedMotion({command.speed_m_s, command.turn_rad_s}, options_.sensors, MixSeed(seed_, num_draws_++));
  const double way = motion_.speed_m_s * seconds;
  PlanarPose axle = Axle();
  const double heading = axle.heading_rad + 0.5 * motion_.turn_rad_s * seconds;
  const Eigen::Vector2d moved = axle.position + way * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  const double before = ClearanceM(*building_, axle.position.x(), axle.position.y());
  const double after = ClearanceM(*building_, moved.x(), moved.y());
  const bool is_stopped = way != 0 && after < options_.radius_m && after < before;
  if (!is_stopped) axle.position = moved;
  axle.heading_rad += motion_.turn_rad_s * seconds;
  PutAxleAt(axle);
  if (is_stopped) motion_ = {};
  return !is_stopped;
}

// By its wheels alone; then it stands.
void Robot::TurnOnTheSpot(double turn_rad) {
  const PlanarMotion slipped = SlippedMotion({0, turn_rad}, options_.sensors, MixSeed(seed_, num_draws_++));
  PlanarPose axle = Axle();
  axle.heading_rad += slipped.turn_rad_s;
  PutAxleAt(axle);
  motion_ = {};
}

RobotLeg Robot::Steer(const ServoTarget& target, bool is_goal) {
  const Camera camera = AssumedCamera();
  ImageServo servo =
      *ImageServo::ToTarget(target, camera,
                            {.servo = is_goal ? servo_options_ : PassingServo(servo_options_, options_.pass),
                             .sift = options_.sift});
  RobotLeg leg;
  int num_blocked = 0, num_searched = 0;
  double searched_deg = 0;  // turned since it lost the target, as commanded
  while (static_cast<int>(leg.steps.size()) < options_.max_num_commands) {
    ServoCommand command = *servo.StepFeatures(Look(), camera);
    command.epipoles.reset();
    leg.steps.push_back({pose_, command});
    leg.why = command.why;
    leg.arrived = command.state == ServoState::kArrived;
    if (leg.arrived) break;
    if (command.state == ServoState::kLost) {
      const bool gives_up = num_searched == static_cast<int>(std::size(kSearchDeg));
      const double next_deg = gives_up ? 0 : kSearchDeg[num_searched++];
      TurnOnTheSpot(RadFromDeg(next_deg - searched_deg));
      searched_deg = next_deg;
      if (gives_up) return leg;
      continue;
    }
    leg.seen = true;
    num_searched = 0;
    searched_deg = 0;
    if (Move(command)) continue;
    if (++num_blocked == kMaxNumBlocked) {
      leg.why = "something stands in the way: " + leg.why;
      return leg;
    }
    servo.Blocked();
  }
  motion_ = {};  // it stands
  if (!leg.arrived) {
    leg.why = fmt::format("not there after {} commands: {}", options_.max_num_commands, leg.why);
  }
  return leg;
}

}  // namespace cairn::sim
