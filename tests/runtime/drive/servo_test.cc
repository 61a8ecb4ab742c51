#include "runtime/drive/servo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <tuple>

#include "core/geometry/pose.h"
#include "tests/option_limits.h"
#include "tests/runtime/drive/servo_scene.h"

namespace cairn {
namespace {

using testing::HasSubstr;

struct Drive {
  PlanarPose end;
  ServoCommand last;
  int num_steps = 0;
  double greatest_speed_m_s = 0, greatest_turn_rad_s = 0;
  bool went_backwards = false;
  double least_x_m = 0;  // of the floor frame
  int num_blocked = 0;
};

PlanarPose Composed(const PlanarPose& a, const PlanarPose& b) {
  return {a.FloorFromRobot(b.position), WrapAngle(a.heading_rad + b.heading_rad)};
}
PlanarPose Inverse(const PlanarPose& pose) { return {pose.RobotFromFloor({0, 0}), -pose.heading_rad}; }

// Something stands behind this x of the floor frame.
constexpr double kNoWall = -std::numeric_limits<double>::infinity();

Drive DriveTo(const ServoScene& scene, const PlanarPose& start, const PlanarPose& target,
              const ServoOptions& options = {}, double focal_factor = 1, double wall_x_m = kNoWall,
              const PlanarPose& mounting = {}) {
  Camera assumed = scene.camera;
  assumed.params[0] *= focal_factor;
  Servo servo = *Servo::Create(assumed, options);
  Random random(7);
  Drive drive{start};
  for (; drive.num_steps < 300; ++drive.num_steps) {
    drive.last = servo.Step(scene.Match(drive.end, target, &random));
    if (drive.last.state == ServoState::kArrived || drive.last.state == ServoState::kLost) break;
    drive.greatest_speed_m_s = std::max(drive.greatest_speed_m_s, std::abs(drive.last.speed_m_s));
    drive.greatest_turn_rad_s = std::max(drive.greatest_turn_rad_s, std::abs(drive.last.turn_rad_s));
    drive.went_backwards |= drive.last.speed_m_s < 0;
    const PlanarPose axle = Moved(Composed(drive.end, Inverse(mounting)), drive.last.speed_m_s,
                                  drive.last.turn_rad_s, options.step_s);
    const PlanarPose moved = Composed(axle, mounting);
    drive.end.heading_rad = moved.heading_rad;
    if (moved.position.x() > wall_x_m || moved.position.x() > drive.end.position.x()) {
      drive.end.position = moved.position;
    } else {
      ++drive.num_blocked;
      servo.Blocked();
    }
    drive.least_x_m = std::min(drive.least_x_m, drive.end.position.x());
  }
  return drive;
}

ServoScene Room() {
  ServoScene scene;
  scene.points = RoomPoints({-5, -3}, {5, 3}, 700, 1);
  return scene;
}

void ExpectThere(const Drive& drive, const PlanarPose& target, const std::string& what) {
  EXPECT_EQ(drive.last.state, ServoState::kArrived) << what << ": " << drive.last.why;
  EXPECT_LT((drive.end.position - target.position).norm(), 0.05) << what;
  EXPECT_LT(std::abs(WrapAngle(drive.end.heading_rad - target.heading_rad)), RadFromDeg(2)) << what;
}

TEST(ServoKinematics, AgreesWithFiniteDifferences) {
  const PlanarPose target{{0.4, -0.3}, 0.7};
  constexpr double kStep = 1e-6;
  const auto polar = [&](const PlanarPose& pose) {
    const Eigen::Vector2d to_target = pose.RobotFromFloor(target.position);
    const Eigen::Vector2d to_robot = target.RobotFromFloor(pose.position);
    return Eigen::Vector3d(to_target.norm(), std::atan2(to_target.y(), to_target.x()),
                           std::atan2(to_robot.y(), to_robot.x()));
  };
  for (const double v : {0.5, -0.3, 0.0}) {
    for (const double w : {0.4, -0.8, 0.0}) {
      for (const PlanarPose& pose : {PlanarPose{{-1, 0.5}, 0.2}, PlanarPose{{1.5, -1}, -2.1}}) {
        const Eigen::Vector3d now = polar(pose);
        const Eigen::Vector3d ahead = polar(Moved(pose, v, w, kStep)),
                              back = polar(Moved(pose, v, w, -kStep));
        const PolarRates rates = RatesOf(now[0], now[1], v, w);
        EXPECT_NEAR(rates.rho_m_s, (ahead[0] - back[0]) / (2 * kStep), 1e-6);
        EXPECT_NEAR(rates.psi_rad_s, WrapAngle(ahead[1] - back[1]) / (2 * kStep), 1e-6);
        EXPECT_NEAR(rates.phi_rad_s, WrapAngle(ahead[2] - back[2]) / (2 * kStep), 1e-6);
      }
    }
  }
}

TEST(Servo, ReachesTheTargetFromAllSides) {
  const ServoScene scene = Room();
  const PlanarPose target;
  for (const PlanarPose& start : {PlanarPose{{-2, 0}, 0}, PlanarPose{{-1.5, 0.6}, 0.5}, PlanarPose{{0, 1}, 0},
                                  PlanarPose{{1, -0.4}, -0.2}}) {
    ExpectThere(DriveTo(scene, start, target), target,
                fmt::format("from {:g}, {:g}", start.position.x(), start.position.y()));
  }
}

TEST(Servo, ReachesATargetAnywhereOnTheFloor) {
  const ServoScene scene = Room();
  const PlanarPose target{{1, 0.5}, 2.6}, start{{2.1, 0.3}, 2.4};
  ExpectThere(DriveTo(scene, start, target), target, "turned frame");
}

TEST(Servo, ToleratesAWrongFocalLengthNoiseAndFalseMatches) {
  ServoScene scene = Room();
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.2;
  const PlanarPose target, start{{-1.8, 0.5}, 0.3};
  for (const double factor : {0.8, 1.0, 1.2}) {
    ExpectThere(DriveTo(scene, start, target, {}, factor), target, fmt::format("focal x {:g}", factor));
  }
}

// It turns about the middle of its axle, not about its camera.  The scene's distance is known, as in a map in
// metres: the camera's place on the robot counts by it.
TEST(Servo, KnowsWhereTheCameraIsOnTheRobot) {
  ServoScene scene = Room();
  scene.noise_px = 0.5;
  const auto num_arrivals = [&](const PlanarPose& mounting, const ServoOptions& options) {
    int num_there = 0;
    for (const double x : {-1.5, -0.5, 0.3}) {
      for (const double y : {-0.5, 0.0, 0.2}) {
        const Drive drive = DriveTo(scene, {{x, y}, 0.1}, {}, options, 1, kNoWall, mounting);
        num_there += drive.last.state == ServoState::kArrived && drive.end.position.norm() < 0.05;
      }
    }
    return num_there;
  };
  for (const auto& [ahead_m, left_m, turn_deg] : {std::tuple(0.2, 0.0, 0.0), std::tuple(-0.2, 0.0, 0.0),
                                                  std::tuple(0.0, 0.2, -30.0), std::tuple(0.2, -0.1, 10.0)}) {
    const ServoOptions known = {.scene_distance_m = 2.5,
                                .camera_ahead_m = ahead_m,
                                .camera_left_m = left_m,
                                .camera_turn_deg = turn_deg};
    const PlanarPose mounting{{ahead_m, left_m}, RadFromDeg(turn_deg)};
    EXPECT_EQ(num_arrivals(mounting, known), 9) << ahead_m << ", " << left_m << ", " << turn_deg;
  }
  EXPECT_LT(num_arrivals({{-0.2, 0}, 0}, {.scene_distance_m = 2.5}), 7) << "mounted there, and not known";
  EXPECT_LT(num_arrivals({{0, 0}, RadFromDeg(-30)}, {.scene_distance_m = 2.5}), 7);
}

TEST(Servo, ReversesToATargetBehindIt) {
  const PlanarPose target, start{{1.2, 0}, 0};
  const Drive drive = DriveTo(Room(), start, target);
  ExpectThere(drive, target, "behind");
  EXPECT_TRUE(drive.went_backwards);
}

TEST(Servo, ReversesAlongItsWayWithoutAFartherRetreat) {
  const PlanarPose target;
  for (const PlanarPose& start : {PlanarPose{{0.8, 0.02}, 0}, PlanarPose{{0.9, 0.3}, 0.5}}) {
    ServoScene scene = Room();
    scene.noise_px = 0.3;
    const Drive drive = DriveTo(scene, start, target);
    ExpectThere(drive, target, fmt::format("from {:g}, {:g}", start.position.x(), start.position.y()));
    EXPECT_GT(drive.least_x_m, -0.1) << "it must not need the room behind the target";
  }
}

TEST(Servo, GoesTheOtherWayWhereSomethingStopsIt) {
  const PlanarPose target, start{{0, 0.5}, 0};
  EXPECT_LT(DriveTo(Room(), start, target).least_x_m, -0.4);  // its retreat
  const Drive drive = DriveTo(Room(), start, target, {}, 1, -0.25);
  ExpectThere(drive, target, "a wall behind");
  EXPECT_GT(drive.num_blocked, 0);
  EXPECT_GE(drive.least_x_m, -0.25);
}

TEST(Servo, IsLessExactingTheLongerItTakes) {
  ServoScene scene = Room();
  scene.points.resize(200);
  scene.noise_px = 2.5;
  const PlanarPose target, start{{-0.5, 0.3}, 0.2};
  const Drive exacting = DriveTo(scene, start, target, {.patience_commands = 1000});
  EXPECT_NE(exacting.last.state, ServoState::kArrived);
  const Drive patient = DriveTo(scene, start, target, {.patience_commands = 40});
  EXPECT_EQ(patient.last.state, ServoState::kArrived);
  EXPECT_LT((patient.end.position - target.position).norm(), 0.3);
}

TEST(Servo, TurnsOnTheSpotWhereOnlyTheHeadingDiffers) {
  ServoScene scene = Room();
  scene.noise_px = 0.3;
  const PlanarPose target, start{{0, 0}, 0.4};
  const Drive drive = DriveTo(scene, start, target);
  ExpectThere(drive, target, "turned");
  EXPECT_LT((drive.end.position - start.position).norm(), 0.04);
}

TEST(Servo, FindsItsWayByAWallAndItsFloor) {
  ServoScene scene;
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    const double y = random.Uniform(-6, 6), z = random.Uniform(-1, 1.6), x = random.Uniform(1.5, 3.5);
    scene.points.push_back(i % 4 == 0 ? Eigen::Vector3d(x, y, -1) : Eigen::Vector3d(3.5, y, z));
  }
  scene.noise_px = 0.3;
  const PlanarPose target;
  for (const double factor : {0.8, 1.0, 1.2}) {
    ExpectThere(DriveTo(scene, {{-1, 0.4}, 0.1}, target, {}, factor), target, fmt::format("x {:g}", factor));
  }
}

TEST(Servo, ArrivesAtOnceWhereItStands) {
  const Drive drive = DriveTo(Room(), {}, {});
  EXPECT_EQ(drive.num_steps, 0);
  EXPECT_EQ(drive.last.state, ServoState::kArrived);
  EXPECT_EQ(drive.last.speed_m_s, 0);
}

TEST(Servo, KeepsToItsGreatestSpeeds) {
  ServoOptions options;
  options.max_speed_m_s = 0.2;
  options.max_turn_deg_s = 20;
  const Drive drive = DriveTo(Room(), {{-2, 0.5}, 0.6}, {}, options);
  ExpectThere(drive, {}, "slow");
  EXPECT_LE(drive.greatest_speed_m_s, 0.2);
  EXPECT_LE(drive.greatest_turn_rad_s, RadFromDeg(20));
  EXPECT_GT(drive.greatest_speed_m_s, 0.15);
}

TEST(Servo, LearnsHowFarTheSceneIs) {
  const ServoScene scene = Room();
  const auto learnt_m = [&](const PlanarPose& start, const PlanarPose& mounting) {
    Servo servo = *Servo::Create(scene.camera, {.camera_ahead_m = mounting.position.x(),
                                                .camera_left_m = mounting.position.y(),
                                                .camera_turn_deg = DegFromRad(mounting.heading_rad)});
    EXPECT_DOUBLE_EQ(servo.scene_distance_m(), 1);
    Random random(1);
    PlanarPose axle = start;
    for (int step = 0; step < 12; ++step) {
      const ServoCommand command = servo.Step(scene.Match(Composed(axle, mounting), mounting, &random));
      axle = Moved(axle, command.speed_m_s, command.turn_rad_s, ServoOptions().step_s);
    }
    return servo.scene_distance_m();
  };
  EXPECT_NEAR(learnt_m({{-2, 0.1}, 0}, {}), 4.8, 1);
  // While it turns, a camera beside the axle goes another way than the robot.
  const double on_axle_m = learnt_m({{-2, 0.4}, 0.15}, {});
  for (const PlanarPose& mounting :
       {PlanarPose{{0, 0.4}, 0}, PlanarPose{{0, -0.4}, 0}, PlanarPose{{0.3, 0.2}, -0.3}}) {
    EXPECT_NEAR(learnt_m({{-2, 0.4}, 0.15}, mounting), on_axle_m, 0.1 * on_axle_m)
        << mounting.position.transpose();
  }
}

TEST(Servo, StopsAndSaysSoWhereMatchesTellNothing) {
  const ServoScene scene = Room();
  const auto step = [&](const std::vector<PixelPair>& pairs) {
    return Servo::Create(scene.camera, {})->Step(pairs);
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const auto& [pairs, why] : std::vector<std::pair<std::vector<PixelPair>, std::string>>{
           {{}, "0 matches"},
           {std::vector<PixelPair>(11, {{100, 50}, {120, 60}}), "11 matches"},
           {std::vector<PixelPair>(90, {{100, 50}, {100, 50}}), "within 0.0 pixels"},
           {std::vector<PixelPair>(90, {{kNan, 50}, {120, kNan}}), "0 matches"},
           {std::vector<PixelPair>(90, {{kInfinity, 50}, {120, -1e300}}), "0 matches"}}) {
    const ServoCommand command = step(pairs);
    EXPECT_EQ(command.state, ServoState::kLost);
    EXPECT_EQ(command.speed_m_s, 0);
    EXPECT_EQ(command.turn_rad_s, 0);
    EXPECT_FALSE(command.epipoles.has_value());
    EXPECT_THAT(command.why, HasSubstr(why));
  }
}

TEST(Servo, GoesOnAfterAnImageWithoutMatches) {
  const ServoScene scene = Room();
  Servo servo = *Servo::Create(scene.camera, {});
  Random random(1);
  const auto pairs = scene.Match({{-1, 0}, 0}, {}, &random);
  EXPECT_EQ(servo.Step(pairs).state, ServoState::kApproaching);
  EXPECT_EQ(servo.Step({}).state, ServoState::kLost);
  EXPECT_EQ(servo.Step(pairs).state, ServoState::kApproaching);
}

TEST(Servo, RefusesBadOptionsAndCameras) {
  const Camera camera = Room().camera;
  ServoOptions options;
  options.max_speed_m_s = -1;
  EXPECT_EQ(Servo::Create(camera, options).error().code, ErrorCode::kInvalidArgument);
  options = {};
  options.epipoles.num_samples = 0;
  EXPECT_EQ(Servo::Create(camera, options).error().code, ErrorCode::kInvalidArgument);
  Camera broken = camera;
  broken.params[0] = -3;
  EXPECT_EQ(Servo::Create(broken, {}).error().code, ErrorCode::kInvalidArgument);
}

TEST(Servo, SameMatchesSameCommands) {
  ServoScene scene = Room();
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.2;
  const Drive one = DriveTo(scene, {{-1, 0.3}, 0.2}, {}), two = DriveTo(scene, {{-1, 0.3}, 0.2}, {});
  EXPECT_EQ(one.end.position, two.end.position);
  EXPECT_EQ(one.num_steps, two.num_steps);
}

TEST(Servo, OptionsHaveTheirRanges) {
  ExpectLimits<ServoOptions>({{"max_speed_m_s", "0.001", "0.0009", "10", "10.001"},
                              {"max_turn_deg_s", "0.1", "0.09", "720", "720.1"},
                              {"step_s", "0.001", "0.0009", "10", "10.001"},
                              {"speed_gain", "0.001", "0.0009", "10", "10.001"},
                              {"turn_gain", "0.001", "0.0009", "10", "10.001"},
                              {"approach_gain", "1.5", "1.499", "10", "10.001"},
                              {"max_heading_deg", "5", "4.999", "60", "60.001"},
                              {"max_heading_error_deg", "1", "0.999", "90", "90.001"},
                              {"arrive_heading_deg", "0.001", "0.0009", "45", "45.001"},
                              {"arrive_distance_ratio", "0.0001", "0.00009", "1", "1.001"},
                              {"patience_commands", "1", "0"},
                              {"max_retreat_ratio", "0.001", "0.0009", "10", "10.001"},
                              {"min_num_matches_to_turn", "4", "3"},
                              {"scene_distance_m", "0.01", "0.009", "1000", "1000.1"},
                              {"camera_ahead_m", "-2", "-2.001", "2", "2.001"},
                              {"camera_left_m", "-2", "-2.001", "2", "2.001"},
                              {"camera_turn_deg", "-45", "-45.001", "45", "45.001"}});
}

}  // namespace
}  // namespace cairn
