#include "stages/reconstruct/floor_plane.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/random.h"
#include "core/geometry/pose.h"

namespace cairn::reconstruct {
namespace {

using testing::HasSubstr;

constexpr double kHeight = 0.8;

// A robot that drives a loop in a room of 6 x 5 x 2.5, whose camera sees what is within `range`.
//
//   z |  walls all around                The world is turned by `turned`, as a reconstruction is.
//     |     o  camera, 0.8 over the floor
//     |_____________ x
class Room {
 public:
  explicit Room(uint64_t seed, double range = 3) : random_(seed), range_(range) {
    for (int i = 0; i < 60; ++i) {
      const double angle = 2 * std::numbers::pi * i / 60;
      cameras_.emplace_back(3 + 1.5 * std::cos(angle), 2.5 + std::sin(angle),
                            kHeight + random_.Normal(0, 0.004));
    }
  }
  void AddWalls(int num_points) {
    for (int i = 0; i < num_points; ++i) {
      const double x = random_.Uniform(0, 6), y = random_.Uniform(0, 5), z = random_.Uniform(0, 2.5);
      switch (i % 4) {
        case 0:
          Add({x, 0, z});
          break;
        case 1:
          Add({x, 5, z});
          break;
        case 2:
          Add({0, y, z});
          break;
        default:
          Add({6, y, z});
      }
    }
  }
  // A level rectangle.
  void AddLevel(int num_points, double z, double x0 = 0, double y0 = 0, double x1 = 6, double y1 = 5) {
    for (int i = 0; i < num_points; ++i) Add({random_.Uniform(x0, x1), random_.Uniform(y0, y1), z});
  }
  std::vector<Eigen::Vector3d>& cameras() { return cameras_; }
  Result<FloorPlane> Find(double up_error_deg = 0) const {
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized()));
    std::vector<Eigen::Vector3d> centers;
    for (const Eigen::Vector3d& camera : cameras_) centers.push_back(turned * camera);
    std::vector<SeenPoint> points = points_;
    for (SeenPoint& point : points) point.position = turned * point.position;
    const Eigen::Vector3d up =
        Eigen::AngleAxisd(RadFromDeg(up_error_deg), Eigen::Vector3d::UnitX()) * Eigen::Vector3d::UnitZ();
    Result<FloorPlane> floor = FindFloor(points, centers, turned * up);
    if (floor.ok()) floor->up = turned.conjugate() * floor->up;
    return floor;
  }

 private:
  void Add(const Eigen::Vector3d& place) {
    SeenPoint point{.position = place + 0.005 * Eigen::Vector3d(random_.Normal(0, 1), random_.Normal(0, 1),
                                                                random_.Normal(0, 1))};
    for (size_t camera = 0; camera < cameras_.size(); ++camera) {
      if ((cameras_[camera] - place).norm() < range_) point.cameras.push_back(static_cast<int>(camera));
    }
    if (!point.cameras.empty()) points_.push_back(std::move(point));
  }
  Random random_;
  double range_;
  std::vector<Eigen::Vector3d> cameras_;
  std::vector<SeenPoint> points_;
};

TEST(FindFloor, FindsTheCamerasHeightOverIt) {
  Room room(1);
  room.AddWalls(2000);
  room.AddLevel(300, 0);
  const auto floor = room.Find();
  ASSERT_TRUE(floor.ok()) << floor.error().message;
  EXPECT_NEAR(floor->height, kHeight, 0.003);
  EXPECT_GT(floor->up.z(), std::cos(RadFromDeg(0.3)));
  EXPECT_GE(floor->sigma_ratio, 0.005);
  EXPECT_LT(floor->sigma_ratio, 0.01);
  EXPECT_EQ(floor->cameras.size(), 60u);
  EXPECT_EQ(floor->cameras.size(), floor->heights.size());
  EXPECT_NEAR(floor->num_points, 300, 40);
}

// The plane of a drive is level, though its camera is tilted by 20 degrees; of a drive straight ahead nobody
// knows.
TEST(FindFloor, TheDriveIsLevelWhereItTurns) {
  Room room(2, 4.5);  // what is far is above a camera that takes its tilt for level
  room.AddWalls(2000);
  room.AddLevel(300, 0);
  EXPECT_NEAR(room.Find(14)->height, kHeight, 0.01);
  EXPECT_EQ(room.Find(14)->num_points, room.Find(0)->num_points);
  const auto tilted = room.Find(20);
  EXPECT_FALSE(tilted.ok());
}

// Furniture has level tops, nearer to the camera than the floor.
TEST(FindFloor, TablesAreNotTheFloor) {
  Room room(3);
  room.AddWalls(500);
  room.AddLevel(300, 0);
  room.AddLevel(200, 0.5, 1, 1, 3, 2);
  EXPECT_NEAR(room.Find()->height, kHeight, 0.003);
  Room bare(4);  // its floor has hardly a texture
  bare.AddWalls(500);
  bare.AddLevel(100, 0);
  bare.AddLevel(300, 0.5, 1, 1, 5, 4);
  const auto two = bare.Find();
  ASSERT_FALSE(two.ok());
  EXPECT_EQ(two.error().code, ErrorCode::kNoData);
  EXPECT_THAT(two.error().message, HasSubstr("two level planes lie below the cameras"));
  EXPECT_THAT(two.error().message, HasSubstr("times as far down with"));
  Room only(5);  // none at all, and walls that go on below
  only.AddWalls(1000);
  only.AddLevel(300, 0.5, 1, 1, 5, 4);
  const auto top = only.Find();
  ASSERT_FALSE(top.ok());
  EXPECT_THAT(top.error().message, HasSubstr("points below itself: it is not the floor"));
}

TEST(FindFloor, WithoutAFloorItSaysWhatThereIs) {
  Room up(6);  // looks up: only the upper half of the walls
  up.AddLevel(300, 2.5);
  const auto nothing = up.Find();
  ASSERT_FALSE(nothing.ok());
  EXPECT_THAT(nothing.error().message, HasSubstr("0 of 299 points lie below the cameras"));
  Room clutter(7);  // at every height
  for (int i = 0; i < 40; ++i) clutter.AddLevel(30, 0.0175 * i);
  const auto no_plane = clutter.Find();
  ASSERT_FALSE(no_plane.ok());
  Room few(10);
  few.AddWalls(240);
  const auto too_few = few.Find();
  ASSERT_FALSE(too_few.ok());
  EXPECT_THAT(too_few.error().message, HasSubstr("lie on one level plane, and a floor needs 50"));
  EXPECT_THAT(no_plane.error().message, HasSubstr("as near above it: it does not stand out"));
}

// By hand, up and down: 0.8 is the height of none of them.
TEST(FindFloor, CamerasAtNoOneHeightAreRefused) {
  Room room(8);
  for (size_t i = 0; i < room.cameras().size(); ++i)
    room.cameras()[i].z() += 0.3 * std::sin(2 * std::numbers::pi * static_cast<double>(i) / 20);
  room.AddWalls(500);
  room.AddLevel(500, 0);
  const auto floor = room.Find();
  ASSERT_FALSE(floor.ok());
  EXPECT_THAT(floor.error().message, HasSubstr("heights over the floor differ by"));
}

TEST(FindFloor, FewCamerasThatSeeItAreTooFew) {
  Room room(9);
  room.cameras().resize(4);
  room.AddWalls(500);
  room.AddLevel(500, 0);
  const auto floor = room.Find();
  ASSERT_FALSE(floor.ok());
  EXPECT_THAT(floor.error().message, HasSubstr("4 cameras see 5 points of the floor each"));
}

// Errors of the cameras' places are in the standard deviation: over many rooms the heights spread as it says.
TEST(FindFloor, SaysHowWellItKnowsTheHeight) {
  double sum = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Room room(seed);
    Random random(100 + seed);
    double error = 0;
    for (size_t i = 0; i < room.cameras().size(); ++i) {
      if (i % 10 == 0) error = random.Normal(0, 0.03);  // of ten in a row, as a bent reconstruction has them
      room.cameras()[i].z() += error;
    }
    room.AddWalls(200);
    room.AddLevel(300, 0);
    const auto floor = room.Find();
    ASSERT_TRUE(floor.ok()) << floor.error().message;
    sum += std::pow((floor->height / kHeight - 1) / floor->sigma_ratio, 2);
  }
  EXPECT_GT(std::sqrt(sum / 40), 0.6);
  EXPECT_LT(std::sqrt(sum / 40), 1.6);
}

}  // namespace
}  // namespace cairn::reconstruct
