#include "runtime/belief/robot_on_plan.h"

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/blocks/map_head.h"
#include "core/geometry/pose.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

std::shared_ptr<const Views> Room() {
  Views views;
  views.plan.walls = OddRoom();
  return std::make_shared<const Views>(std::move(views));
}

RangeScan ScanAt(const PlanarPose& laser, Random* random) {
  RangeScan scan;
  scan.first_angle_rad = RadFromDeg(-90);
  scan.step_rad = RadFromDeg(1);
  for (const Beam& beam : BeamsAt(OddRoom(), laser, 0.01, random)) scan.ranges_m.push_back(beam.range_m);
  return scan;
}

// What is seen at a place, with little noise.
PossiblePlace At(const PlanarPose& pose, double probability = 1) {
  PossiblePlace place;
  place.pose = pose;
  place.covariance = 1e-4 * Eigen::Matrix3d::Identity();
  place.probability = probability;
  return place;
}

TEST(RobotOnPlan, WithItsLaserAboveTheAxleItIsATrackerBitForBit) {
  const std::shared_ptr<const Views> plan = Room();
  RobotOnPlan robot = *RobotOnPlan::Make(plan);
  PlanTracker tracker = *PlanTracker::Make(*plan);
  Random random(1);
  PlanarPose pose{{1, 3}, -0.4};
  for (int i = 0; i < 5; ++i) {
    const FloorMotion step{{0.35, 0.02}, 0.25};
    if (i > 0) {
      ASSERT_TRUE(robot.Move(step).ok());
      ASSERT_TRUE(tracker.Move(step).ok());
      pose = pose * PlanarPose{step.way_m, step.turn_left_rad};
    }
    const RangeScan scan = ScanAt(pose, &random);
    ASSERT_TRUE(robot.SeeScan(scan).ok());
    ASSERT_TRUE(tracker.SeeScan(ViewOf(scan, {})).ok());
    const std::vector<PossiblePlace> places = robot.Places();
    ASSERT_EQ(places.size(), tracker.belief().places().size());
    for (size_t k = 0; k < places.size(); ++k) {
      EXPECT_EQ(places[k].pose.position, tracker.belief().places()[k].pose.position);
      EXPECT_EQ(places[k].pose.heading_rad, tracker.belief().places()[k].pose.heading_rad);
      EXPECT_EQ(places[k].covariance, tracker.belief().places()[k].covariance);
      EXPECT_EQ(places[k].probability, tracker.belief().places()[k].probability);
    }
    EXPECT_EQ(robot.elsewhere(), tracker.belief().elsewhere());
  }
  EXPECT_LT((robot.Places()[0].pose.position - pose.position).norm(), 0.05);
}

// Half a metre ahead of the axle, to its right, looking right: on the spot the laser moves, the robot does
// not.
TEST(RobotOnPlan, ALaserIsCarriedAroundTheAxle) {
  RobotOnPlan robot =
      *RobotOnPlan::Make(Room(), {.laser_ahead_m = 0.5, .laser_left_m = -0.2, .laser_turn_deg = -90});
  ASSERT_TRUE(robot.SeePlaces(std::vector{At({{3, 2.5}, 0})}).ok());
  ASSERT_TRUE(robot.Move({{0, 0}, 1}).ok());
  PossiblePlace place = robot.Places()[0];
  EXPECT_TRUE(place.pose.position.isApprox(Eigen::Vector2d(3, 2.5), 1e-9));
  EXPECT_NEAR(place.pose.heading_rad, 1, 1e-9);
  ASSERT_TRUE(robot.Move({{0.4, 0.1}, 0}).ok());
  place = robot.Places()[0];
  const PlanarPose expected = PlanarPose{{3, 2.5}, 1} * PlanarPose{{0.4, 0.1}, 0};
  EXPECT_TRUE(place.pose.position.isApprox(expected.position, 1e-9));
  // And what the laser sees there is seen by this robot.
  Random random(2);
  ASSERT_TRUE(robot.SeeScan(ScanAt(expected * PlanarPose{{0.5, -0.2}, -RadFromDeg(90)}, &random)).ok());
  EXPECT_LT((robot.Places()[0].pose.position - expected.position).norm(), 0.05);
  EXPECT_GT(robot.Places()[0].probability, 0.95);
}

// What is known of the robot by what is known of its laser, and back: the heading moves what is far from it.
TEST(RobotOnPlan, CovariancesAreThoseOfTheRobot) {
  RobotOnPlan robot = *RobotOnPlan::Make(Room(), {.laser_ahead_m = 2});
  PossiblePlace seen = At({{3, 2.5}, 0});
  seen.covariance = Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal();
  seen.covariance(0, 2) = seen.covariance(2, 0) = 0.004;
  ASSERT_TRUE(robot.SeePlaces(std::vector{seen}).ok());
  EXPECT_TRUE(robot.Places()[0].covariance.isApprox(seen.covariance, 1e-9));
  // Known there, at the laser: its y has the variance of the heading, at 2 m.
  const UncertainPlanarPose laser = seen * PlanarPose{{2, 0}, 0};
  EXPECT_NEAR(laser.covariance(1, 1), 0.02 + 4 * 0.03, 1e-12);
  EXPECT_NEAR(laser.covariance(1, 2), 2 * 0.03, 1e-12);
  EXPECT_NEAR(laser.covariance(0, 0), 0.01, 1e-12);
}

TEST(RobotOnPlan, ItsCameraSaysWhereItIs) {
  RobotOnPlan robot = *RobotOnPlan::Make(Room(), {.laser_ahead_m = 0.1,
                                                  .laser_turn_deg = 45,
                                                  .camera_ahead_m = 0.3,
                                                  .camera_left_m = 0.1,
                                                  .camera_turn_deg = 90});
  // A camera 1.2 m high that looks along y, on a robot that looks along x.
  Localization found;
  Eigen::Matrix3d floor_from_cam;
  floor_from_cam << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  found.reason = NoFix::kNone;
  found.cam_from_world = Pose{Eigen::Quaterniond(floor_from_cam), {3.3, 2.6, 1.2}}.Inverse();
  found.covariance = 1e-4 * Matrix6d::Identity();
  found.probability = 0.9;
  ASSERT_TRUE(robot.SeeImage(found, MapHead()).ok());
  EXPECT_TRUE(robot.Places()[0].pose.position.isApprox(Eigen::Vector2d(3, 2.5), 1e-9));
  EXPECT_NEAR(robot.Places()[0].pose.heading_rad, 0, 1e-9);
  MapHead no_metres;
  no_metres.frame.unit = "arbitrary";
  EXPECT_EQ(robot.SeeImage(found, no_metres).error().code, ErrorCode::kUnsupported);
}

TEST(RobotOnPlan, WheelsAreToldByWaysOrByPoses) {
  const std::shared_ptr<const Views> plan = Room();
  RobotOnPlan by_ways = *RobotOnPlan::Make(plan), by_poses = *RobotOnPlan::Make(plan);
  for (RobotOnPlan* robot : {&by_ways, &by_poses})
    ASSERT_TRUE(robot->SeePlaces(std::vector{At({{1, 3}, 0.5})}).ok());
  PlanarPose wheels{{100, -3}, 3};
  ASSERT_TRUE(by_poses.MoveTo(wheels).ok());  // moves nothing
  EXPECT_EQ(by_poses.Places()[0].pose.position, by_ways.Places()[0].pose.position);
  for (const FloorMotion& step : {FloorMotion{{0.4, 0}, 0.3}, {{0.2, 0.1}, -1}}) {
    wheels = wheels * PlanarPose{step.way_m, step.turn_left_rad};
    ASSERT_TRUE(by_poses.MoveTo(wheels).ok());
    ASSERT_TRUE(by_ways.Move(step).ok());
    EXPECT_TRUE(by_poses.Places()[0].pose.position.isApprox(by_ways.Places()[0].pose.position, 1e-9));
    EXPECT_NEAR(by_poses.Places()[0].pose.heading_rad, by_ways.Places()[0].pose.heading_rad, 1e-9);
  }
}

TEST(RobotOnPlan, ProbabilitiesOfPlacesAreAtMostOneInAll) {
  RobotOnPlan robot = *RobotOnPlan::Make(Room());
  EXPECT_TRUE(robot.SeePlaces(std::vector{At({{1, 3}, 0}, 0.5), At({{5, 1}, 0}, 0.5)}).ok());
  EXPECT_EQ(robot.SeePlaces(std::vector{At({{1, 3}, 0}, 0.6), At({{5, 1}, 0}, 0.6)}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(RobotOnPlan::Make(Room(), {.laser_ahead_m = 10.5}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(RobotOnPlan::Make(Room(), {.laser_turn_deg = -180.5}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(RobotOnPlan::Make(Room(), {.camera_turn_deg = 180.5}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(RobotOnPlan::Make(Room(), {.camera_turn_deg = NAN}).error().code, ErrorCode::kInvalidArgument);
}

TEST(RobotOnPlan, PlacesAreCheckedOneByOne) {
  using testing::HasSubstr;
  RobotOnPlan robot = *RobotOnPlan::Make(Room());
  const auto refusal = [&](const PossiblePlace& place) {
    const Status status = robot.SeePlaces(std::vector{At({{1, 3}, 0}, 0.1), place});
    EXPECT_FALSE(status.ok());
    EXPECT_TRUE(robot.Places().empty());
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_THAT(refusal(At({{NAN, 3}, 0}, 0.1)), HasSubstr("place 1 has a number that is not finite"));
  EXPECT_THAT(refusal(At({{1, 3}, INFINITY}, 0.1)), HasSubstr("place 1 has a number that is not finite"));
  EXPECT_THAT(refusal(At({{1, 3}, 0}, 1.5)), HasSubstr("place 1 has a probability of 1.5; expected 0 to 1"));
  EXPECT_THAT(refusal(At({{1, 3}, 0}, -0.1)),
              HasSubstr("place 1 has a probability of -0.1; expected 0 to 1"));
  EXPECT_THAT(refusal(At({{1, 3}, 0}, NAN)), HasSubstr("place 1 has a probability of nan; expected 0 to 1"));
  PossiblePlace place = At({{1, 3}, 0}, 0.1);
  place.covariance(1, 2) = NAN;
  EXPECT_THAT(refusal(place), HasSubstr("place 1 has a number that is not finite"));
  place.covariance = Eigen::Matrix3d::Zero();
  EXPECT_THAT(refusal(place), HasSubstr("some direction has no variance"));
  place.covariance = Eigen::Vector3d(0.01, 0.02, 0).asDiagonal();
  EXPECT_THAT(refusal(place), HasSubstr("some direction has no variance"));
  // Of 0.01 by 1e-4, which is far more than rounding.
  place.covariance = 0.01 * Eigen::Matrix3d::Identity();
  place.covariance(0, 1) = 1e-6;
  EXPECT_THAT(refusal(place), HasSubstr("it is not symmetric"));
  place.covariance(0, 1) = 5e-9;
  place.probability = 0;
  EXPECT_TRUE(robot.SeePlaces(std::vector{place}).ok());
}

TEST(RobotOnPlan, PosesOfWheelsAreFinite) {
  RobotOnPlan robot = *RobotOnPlan::Make(Room());
  ASSERT_TRUE(robot.SeePlaces(std::vector{At({{1, 3}, 0})}).ok());
  ASSERT_TRUE(robot.MoveTo({{5, 5}, 0}).ok());
  EXPECT_EQ(robot.MoveTo({{NAN, 5}, 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(robot.MoveTo({{5, 5}, INFINITY}).error().code, ErrorCode::kInvalidArgument);
  // The pose before is that of the last call which was right.
  ASSERT_TRUE(robot.MoveTo({{5.5, 5}, 0}).ok());
  EXPECT_TRUE(robot.Places()[0].pose.position.isApprox(Eigen::Vector2d(1.5, 3)));
}

}  // namespace
}  // namespace cairn
