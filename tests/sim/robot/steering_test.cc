// A robot in a rendered room is steered through the C API alone: pictures in, commands out.
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/features/sift.h"
#include "core/geometry/planar_pose.h"
#include "core/geometry/pose.h"
#include "runtime/c_api/cairn.h"
#include "sim/render/building.h"
#include "sim/render/renderer.h"
#include "sim/survey/survey.h"

namespace cairn::sim {
namespace {

constexpr double kCameraHeightM = 1.1;
constexpr int kMostCommands = 60;

Building MakeRooms() {
  SimulateOptions options;
  options.furniture_ratio = 0;
  options.pillars_per_room = 0;
  options.texel_m = 0.01;
  return *MakeBuilding(options, 0);
}

Camera MakeSmallCamera() {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 320;
  camera.height = 240;
  camera.params = {160, 160, 120};
  return camera;
}

Pose CameraAt(const PlanarPose& pose) {
  return MakePose({pose.position.x(), pose.position.y(), kCameraHeightM}, pose.heading_rad);
}

// The corridor, as long as the building is wide, and the robot's pictures of it.
class Steering : public testing::Test {
 protected:
  Steering() : building_(MakeRooms()), renderer_(building_, MakeSmallCamera()) {
    for (const Room& room : building_.layout.rooms) {
      if (!room.is_corridor) continue;
      target_.position = {room.rect.x0 + 0.6 * (room.rect.x1 - room.rect.x0),
                          0.5 * (room.rect.y0 + room.rect.y1)};
      if (room.rect.x1 - room.rect.x0 > 4) break;
    }
    WriteMap();
  }

  cv::Mat See(const PlanarPose& pose, uint64_t seed) const {
    const Pose camera = CameraAt(pose);
    return TakeImage(renderer_,
                     {.cam_from_world = camera, .stated_cam_from_world = camera, .noise = 2, .gain = 0.9},
                     seed);
  }

  // One survey image, whose features lie where their rays end.
  void WriteMap() {
    MapRows rows;
    rows.name = "corridor";
    rows.writer = "cairn test";
    rows.landmark_choice = "all";
    rows.cameras = {renderer_.camera()};
    MapImage image{.image_id = 1, .name = "target", .camera_id = 1, .cam_from_world = CameraAt(target_)};
    const Pose world_from_cam = image.cam_from_world.Inverse();
    const Features features = *ExtractSift(See(target_, 1), {});
    std::vector<Eigen::Index> kept;
    for (size_t i = 0; i < features.keypoints.size(); ++i) {
      const auto ray =
          CameraFromImage(renderer_.camera(), {features.keypoints[i].x, features.keypoints[i].y});
      const Eigen::Vector3d direction = world_from_cam.rotation * ray->homogeneous();
      const auto hit = CastRay(building_, world_from_cam.translation, direction);
      if (!hit) continue;
      image.landmarks.push_back(static_cast<LandmarkIdx>(rows.landmarks.size()));
      rows.landmarks.push_back({.position = world_from_cam.translation + hit->distance * direction,
                                .covariance = 1e-6 * Eigen::Matrix3d::Identity(),
                                .num_observations = 1});
      kept.push_back(static_cast<Eigen::Index>(i));
    }
    rows.descriptors.resize(static_cast<Eigen::Index>(kept.size()), kSiftDescriptorDim);
    for (size_t i = 0; i < kept.size(); ++i)
      rows.descriptors.row(static_cast<Eigen::Index>(i)) = features.descriptors.row(kept[i]);
    rows.images.push_back(std::move(image));
    ASSERT_TRUE(WriteMapRows(rows, path_).ok());
  }

  // Where the robot stands when it says that it has arrived, in the target's frame; how many commands it
  // took.
  struct Arrival {
    PlanarPose pose;
    int num_commands = 0;
    std::string why;
  };
  // `mounting`: of the camera on the robot, whose wheels turn it about its origin; `camera`: where it begins.
  Arrival Steer(const PlanarPose& camera, cairn_servo* servo, const PlanarPose& mounting = {}) const {
    PlanarPose robot;
    robot.heading_rad = camera.heading_rad - mounting.heading_rad;
    robot.position =
        camera.position - PlanarPose{{0, 0}, robot.heading_rad}.FloorFromRobot(mounting.position);
    PlanarPose pose = camera;
    Arrival arrival;
    cairn_servo_command command = CAIRN_SERVO_COMMAND_INIT;
    for (; arrival.num_commands < kMostCommands && command.state != CAIRN_SERVO_ARRIVED;
         ++arrival.num_commands) {
      const cv::Mat picture = See(pose, 100 + arrival.num_commands);
      cairn_image image = CAIRN_IMAGE_INIT;
      image.pixels = picture.data;
      image.width = picture.cols;
      image.height = picture.rows;
      image.stride = picture.step;
      EXPECT_EQ(cairn_servo_step(servo, &image, nullptr, &command), CAIRN_OK) << cairn_last_error();
      const double way = command.speed_m_s * command.step_s, turn = command.turn_rad_s * command.step_s;
      robot.position = robot.FloorFromRobot({way * std::cos(turn / 2), way * std::sin(turn / 2)});
      robot.heading_rad += turn;
      pose = {robot.FloorFromRobot(mounting.position), robot.heading_rad + mounting.heading_rad};
    }
    arrival.why = command.why;
    arrival.pose = {target_.RobotFromFloor(pose.position), WrapAngle(pose.heading_rad - target_.heading_rad)};
    return arrival;
  }

  Building building_;
  Renderer renderer_;
  PlanarPose target_;
  std::string path_ = testing::TempDir() + "/steering.cairn";
};

TEST_F(Steering, BringsARobotToWhereAnImageWasTaken) {
  cairn_map* map = nullptr;
  ASSERT_EQ(cairn_map_open(path_.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
  // Behind the target, beside it, in front of it; in metres ahead and to the left, degrees to the left.
  for (const auto& [ahead_m, left_m, turn_deg] :
       {std::tuple(-0.9, 0.2, -10.0), std::tuple(-0.4, -0.3, 5.0), std::tuple(0.4, 0.1, 8.0)}) {
    const PlanarPose start = {target_.FloorFromRobot({ahead_m, left_m}),
                              target_.heading_rad + RadFromDeg(turn_deg)};
    ASSERT_GT(ClearanceM(building_, start.position.x(), start.position.y()), 0.2);
    cairn_servo* servo = nullptr;
    ASSERT_EQ(cairn_servo_create(map, 0, &servo), CAIRN_OK) << cairn_last_error();
    const Arrival exact = Steer(start, servo);
    EXPECT_LT(exact.num_commands, kMostCommands) << exact.why;
    EXPECT_LT(exact.pose.position.norm(), 0.05) << ahead_m << ": " << exact.pose.position.transpose();
    EXPECT_LT(std::abs(DegFromRad(exact.pose.heading_rad)), 1.5);
    // An image on the way: sooner, and less exact.
    ASSERT_EQ(cairn_servo_set_option(servo, "arrive_distance_ratio", "0.04"), CAIRN_OK);
    ASSERT_EQ(cairn_servo_set_option(servo, "arrive_heading_deg", "4"), CAIRN_OK);
    const Arrival passing = Steer(start, servo);
    EXPECT_LE(passing.num_commands, exact.num_commands);
    EXPECT_LT(passing.pose.position.norm(), 0.3);
    EXPECT_EQ(cairn_servo_destroy(servo), CAIRN_OK);
  }
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

// Cameras ahead of the axle, behind it, beside it, and turned: a robot that does not know moves to and fro
// for ever.
TEST_F(Steering, KnowsWhereTheCameraIsOnTheRobot) {
  cairn_map* map = nullptr;
  ASSERT_EQ(cairn_map_open(path_.c_str(), nullptr, &map), CAIRN_OK) << cairn_last_error();
  const auto steer = [&](const PlanarPose& mounting, const PlanarPose& believed, double ahead_m,
                         double left_m, double turn_deg) {
    const PlanarPose start = {target_.FloorFromRobot({ahead_m, left_m}),
                              target_.heading_rad + RadFromDeg(turn_deg)};
    cairn_servo* servo = nullptr;
    EXPECT_EQ(cairn_servo_create(map, 0, &servo), CAIRN_OK) << cairn_last_error();
    for (const auto& [name, value] : {std::pair("camera_ahead_m", believed.position.x()),
                                      std::pair("camera_left_m", believed.position.y()),
                                      std::pair("camera_turn_deg", DegFromRad(believed.heading_rad))}) {
      EXPECT_EQ(cairn_servo_set_option(servo, name, std::to_string(value).c_str()), CAIRN_OK)
          << cairn_last_error();
    }
    const Arrival arrival = Steer(start, servo, mounting);
    EXPECT_EQ(cairn_servo_destroy(servo), CAIRN_OK);
    return arrival;
  };
  for (const PlanarPose& mounting :
       {PlanarPose{{0.3, 0}, 0}, PlanarPose{{-0.2, 0}, 0}, PlanarPose{{0.1, -0.15}, RadFromDeg(15)}}) {
    for (const auto& [ahead_m, left_m, turn_deg] :
         {std::tuple(-0.9, 0.2, -10.0), std::tuple(0.4, -0.05, 8.0)}) {
      const Arrival arrival = steer(mounting, mounting, ahead_m, left_m, turn_deg);
      EXPECT_LT(arrival.num_commands, kMostCommands) << arrival.why;
      EXPECT_LT(arrival.pose.position.norm(), 0.05) << mounting.position.transpose() << " from " << ahead_m;
      EXPECT_LT(std::abs(DegFromRad(arrival.pose.heading_rad)), 1.5);
    }
  }
  EXPECT_EQ(steer({{-0.2, 0}, 0}, {}, -0.9, 0.2, -10).num_commands, kMostCommands);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

}  // namespace
}  // namespace cairn::sim
