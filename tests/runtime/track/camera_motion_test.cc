#include "runtime/track/camera_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "core/base/random.h"
#include "core/geometry/floor_pose.h"
#include "core/geometry/planar_pose.h"
#include "runtime/localize/refine.h"
#include "runtime/track/region_tracker.h"
#include "tests/runtime/localize/room_drive.h"

namespace cairn {
namespace {

using testing::HasSubstr;

// A camera 1.2 m above the floor that looks 20 degrees down.
Pose Tilted(const Eigen::Vector2d& at, double heading_deg) {
  const Pose level = PoseAt({at.x(), at.y(), 1.2}, heading_deg);
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(RadFromDeg(20), Eigen::Vector3d::UnitX()));
  return Pose{tilt, Eigen::Vector3d::Zero()} * level;
}

// Where it should be, of a drive over the floor by its own frames.
PlanarPose Driven(PlanarPose pose, const FloorMotion& motion) {
  return {pose.FloorFromRobot(motion.way_m), pose.heading_rad + motion.turn_left_rad};
}

TEST(MotionSinceFix, OdometryMovesATiltedCameraOverTheFloor) {
  // The world's floor is turned and lies elsewhere.
  const Pose floor_from_world{
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())), {4, -2, 1}};
  MotionSinceFix motion(Tilted({1, 2}, 30) * floor_from_world, Matrix6d::Zero());
  EXPECT_FALSE(motion.is_told());
  PlanarPose expected{{1, 2}, RadFromDeg(30)};
  for (const FloorMotion& step :
       {FloorMotion{{0.5, 0}, 0.3}, {{0.2, -0.1}, 0}, {{0, 0}, -1}, {{-0.4, 0.3}, 2}}) {
    motion.Add(step, floor_from_world, {});
    expected = Driven(expected, step);
  }
  EXPECT_TRUE(motion.is_told());
  const Pose truth = Tilted(expected.position, DegFromRad(expected.heading_rad)) * floor_from_world;
  EXPECT_LT(CenterErrorM(motion.cam_from_world(), truth), 1e-9);
  EXPECT_LT(RotationErrorDeg(motion.cam_from_world(), truth), 1e-6);
}

TEST(MotionSinceFix, ACameraThatLooksUpDrivesToItsImagesTop) {
  // x right, y down, z up: a tilt of 5 degrees does not turn the robot.
  for (const double tilt_deg : {0.0, 5.0, -5.0}) {
    Eigen::Matrix3d floor_from_cam;
    floor_from_cam.col(0) = Eigen::Vector3d::UnitY();   // right
    floor_from_cam.col(1) = -Eigen::Vector3d::UnitX();  // down in the image: behind
    floor_from_cam.col(2) = Eigen::Vector3d::UnitZ();
    floor_from_cam =
        floor_from_cam * Eigen::AngleAxisd(RadFromDeg(tilt_deg), Eigen::Vector3d::UnitX()).matrix();
    const Pose cam{Eigen::Quaterniond(Eigen::Matrix3d(floor_from_cam.transpose())), Eigen::Vector3d::Zero()};
    MotionSinceFix motion(cam, Matrix6d::Zero());
    motion.Add(FloorMotion{{1, 0}, 0}, Pose(), {});
    EXPECT_LT((motion.cam_from_world().Center() - Eigen::Vector3d::UnitX()).norm(), 1e-9) << tilt_deg;
  }
}

TEST(MotionSinceFix, WhatIsOverTheFloorOfAMotionInSpaceIsThatMotion) {
  for (const FloorMotion& step : {FloorMotion{{0.5, -0.2}, 0.3}, {{0, 0}, -1.2}, {{-0.3, 0.1}, 0}}) {
    MotionSinceFix motion(PoseAt({1, 2, 1}, 40), Matrix6d::Zero());
    motion.Add(step, Pose(), {});
    const FloorMotion found = OverFloor(motion.cam_from_world() * PoseAt({1, 2, 1}, 40).Inverse());
    EXPECT_LT((found.way_m - step.way_m).norm(), 1e-9);
    EXPECT_NEAR(found.turn_left_rad, step.turn_left_rad, 1e-9);
  }
}

// Mean of the normalised error squared, of six degrees of freedom.
double MeanSquare(const std::function<std::pair<Pose, UncertainPose>(Random&)>& trial) {
  Random random(3);
  double sum = 0;
  constexpr int kNumTrials = 4000;
  for (int i = 0; i < kNumTrials; ++i) {
    const auto [truth, predicted] = trial(random);
    const Vector6d error = PerturbationBetween(predicted.pose, truth);
    sum += error.dot(predicted.covariance.ldlt().solve(error));
  }
  return sum / kNumTrials;
}

Vector6d Drawn(const Matrix6d& covariance, Random& random) {
  Vector6d white;
  for (int i = 0; i < 6; ++i) white[i] = random.Normal(0, 1);
  return covariance.llt().matrixL() * white;
}

TEST(MotionSinceFix, ErrorsOfTheFixAndOfMotionsInSpaceAreInTheCovariance) {
  Matrix6d of_fix = Matrix6d::Identity() * 1e-4, of_motion = Matrix6d::Identity() * 4e-4;
  of_fix(0, 4) = of_fix(4, 0) = 5e-5;
  of_motion(5, 5) = 1e-2;
  const Pose step = PoseAt({0.5, 0.1, 0}, 20) * PoseAt({0, 0, 0}, 0).Inverse();
  const double mean = MeanSquare([&](Random& random) {
    const Pose start = PoseAt({1, 2, 1}, 40);
    MotionSinceFix motion(start, of_fix);
    Pose truth = Perturb(start, Drawn(of_fix, random));
    for (int i = 0; i < 3; ++i) {
      motion.Add(UncertainPose{step, of_motion});
      truth = Perturb(step, Drawn(of_motion, random)) * truth;
    }
    return std::pair(truth, motion.Predict({}));
  });
  EXPECT_NEAR(mean, 6, 0.4);
}

// Wheels that err by a twentieth of each half metre and of each 20 degrees.
TEST(MotionSinceFix, ErrorsOfWheelsAreInTheCovarianceHoweverOftenTheyAreRead) {
  for (const auto& [num_readings, drift_deg] : {std::pair(1, 0.0), std::pair(4, 0.0), std::pair(4, 1.5)}) {
    const WheelErrorOptions errors{.wheel_drift_deg = drift_deg};
    const double share = 1.0 / num_readings;
    const double mean = MeanSquare([&](Random& random) {
      const Pose start = PoseAt({1, 2, 1}, 40);
      MotionSinceFix motion(start, Matrix6d::Zero()), truth(start, Matrix6d::Zero());
      for (int i = 0; i < 6; ++i) {
        const FloorMotion reading{{0.5 * share, 0}, RadFromDeg(i % 2 == 0 ? 20 : -20) * share};
        for (int k = 0; k < num_readings; ++k) {
          motion.Add(reading, Pose(), errors);
          const double way_sigma_m = errors.wheel_way_ratio * 0.5 * std::sqrt(share);
          const double turn_sigma_rad =
              std::hypot(errors.wheel_turn_ratio * RadFromDeg(20), RadFromDeg(errors.wheel_drift_deg)) *
              std::sqrt(share);
          const FloorMotion driven{
              {random.Normal(reading.way_m.x(), way_sigma_m), random.Normal(0, way_sigma_m / 3)},
              random.Normal(reading.turn_left_rad, turn_sigma_rad)};
          truth.Add(driven, Pose(), errors);
        }
      }
      // Beyond all that, once.
      const double sigma_rad = RadFromDeg(errors.wheel_turn_sigma_deg), sigma_m = errors.wheel_way_sigma_m;
      Vector6d once;
      once << sigma_rad, sigma_rad, sigma_rad, sigma_m, sigma_m, sigma_m;
      const Matrix6d covariance = once.cwiseAbs2().asDiagonal();
      return std::pair(Perturb(truth.cam_from_world(), Drawn(covariance, random)), motion.Predict(errors));
    });
    EXPECT_NEAR(mean, 6, 0.4) << num_readings << ", " << drift_deg;
  }
}

TEST(WheelCovariance, IsThatOfHalfMetresAndOfTwentyDegrees) {
  const WheelErrorOptions errors{.wheel_way_ratio = 0.1, .wheel_turn_ratio = 0.2, .wheel_drift_deg = 3};
  // Two metres to the left are four times half a metre, each of 5 cm; beside it a third of that.
  const Eigen::Matrix3d straight = WheelCovariance({{0, 2}, 0}, errors);
  EXPECT_NEAR(straight(1, 1), 4 * 0.05 * 0.05, 1e-12);
  EXPECT_NEAR(straight(0, 0), 4 * 0.05 * 0.05 / 9, 1e-12);
  EXPECT_NEAR(straight(0, 1), 0, 1e-12);
  EXPECT_NEAR(straight(2, 2), 4 * RadFromDeg(3) * RadFromDeg(3), 1e-12);
  // Sixty degrees are three times twenty, each of four degrees, to either side.
  for (const double turn_deg : {60.0, -60.0}) {
    const Eigen::Matrix3d turned = WheelCovariance({{0, 0}, RadFromDeg(turn_deg)}, errors);
    EXPECT_NEAR(turned(2, 2), 3 * RadFromDeg(4) * RadFromDeg(4), 1e-12);
    EXPECT_TRUE(turned.topRows<2>().isZero(0));
  }
  // Ahead and to the left at once: errors along the way are those of both axes.
  const Eigen::Matrix3d oblique = WheelCovariance({{1, 1}, 0}, errors);
  const double along = std::sqrt(8) * 0.05 * 0.05;
  EXPECT_NEAR(oblique(0, 0), along * 5 / 9, 1e-12);
  EXPECT_NEAR(oblique(0, 1), along * 4 / 9, 1e-12);
}

TEST(MotionSinceFix, StepsOfWhichNothingIsToldAddUp) {
  MotionSinceFix motion(PoseAt({1, 2, 1}, 40), Matrix6d::Zero());
  for (int i = 0; i < 3; ++i) motion.AddUnknown(Pose(), 0.1, 2);
  EXPECT_DOUBLE_EQ(motion.unknown_sigma_m(), 0.3);
  EXPECT_DOUBLE_EQ(motion.unknown_sigma_deg(), 6);
  const Matrix6d covariance = motion.Predict({}).covariance;
  EXPECT_NEAR(covariance(5, 5), 0.09, 1e-9);
  EXPECT_NEAR(covariance(0, 0), RadFromDeg(6) * RadFromDeg(6), 1e-9);
  EXPECT_FALSE(motion.is_told());
}

TEST(CheckUncertainPose, WhatIsNoPoseOrNoCovarianceIsRefused) {
  const auto error_of = [](const UncertainPose& pose) {
    const Status checked = CheckUncertainPose(pose);
    return checked.ok() ? "" : checked.error().message;
  };
  EXPECT_EQ(error_of({}), "");
  EXPECT_EQ(error_of({PoseAt({1, 2, 3}, 50), Matrix6d::Identity()}), "");
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error_of({{Eigen::Quaterniond(1, kNan, 0, 0), {0, 0, 0}}}), HasSubstr("finite"));
  EXPECT_THAT(error_of({{Eigen::Quaterniond::Identity(), {0, kNan, 0}}}), HasSubstr("finite"));
  EXPECT_THAT(error_of({Pose(), kNan * Matrix6d::Identity()}), HasSubstr("finite"));
  EXPECT_THAT(error_of({{Eigen::Quaterniond(2, 0, 0, 0), {0, 0, 0}}}), HasSubstr("length"));
  Matrix6d skew = Matrix6d::Identity();
  skew(0, 3) = 0.5;
  EXPECT_THAT(error_of({Pose(), skew}), HasSubstr("symmetric"));
  Matrix6d negative = Matrix6d::Identity();
  negative(2, 3) = negative(3, 2) = 1.1;
  EXPECT_THAT(error_of({Pose(), negative}), HasSubstr("negative"));
}

Localization Show(RegionTracker* tracker, int i) {
  return *tracker->TrackFeatures(RenderFeatures(Room(), OnDrive(i), {}, 500 + i), Room().camera);
}
void ShowNothing(RegionTracker* tracker) { ASSERT_TRUE(tracker->TrackFeatures({}, Room().camera).ok()); }
// From frame i to the next, over the floor.
FloorMotion StepFrom(int i) { return OverFloor(OnDrive(i + 1) * OnDrive(i).Inverse()); }

TEST(DarkRoom, OdometryLeadsThroughTheDark) {
  RegionTracker tracker(RoomMap()), blind(RoomMap());
  EXPECT_FALSE(tracker.Believed());
  ASSERT_TRUE(Show(&tracker, 0).has_fix());
  ASSERT_TRUE(Show(&blind, 0).has_fix());
  EXPECT_LT(CenterErrorM(tracker.Believed()->pose, OnDrive(0)), 0.05);
  constexpr int kLight = 40;  // 4 m and 120 degrees later
  for (int i = 0; i + 1 < kLight; ++i) {
    const FloorMotion step = StepFrom(i);
    ASSERT_TRUE(tracker.Move(step.way_m, step.turn_left_rad).ok());
    ShowNothing(&tracker);
    ShowNothing(&blind);
    EXPECT_LT(CenterErrorM(tracker.Believed()->pose, OnDrive(i + 1)), 0.05) << i;
  }
  const FloorMotion step = StepFrom(kLight - 1);
  ASSERT_TRUE(tracker.Move(0.5 * step.way_m, 0).ok());
  ASSERT_TRUE(tracker.Move(0.5 * step.way_m, step.turn_left_rad).ok());
  ASSERT_TRUE(tracker.Prediction());
  EXPECT_LT(CenterErrorM(tracker.Prediction()->cam_from_world, OnDrive(kLight)), 0.05);
  EXPECT_FALSE(blind.Prediction());
  const Localization found = Show(&tracker, kLight);
  EXPECT_EQ(found.scope, Scope::kTrack) << found.message;
  EXPECT_LT(CenterErrorM(found.cam_from_world, OnDrive(kLight)), 0.05);
  EXPECT_NE(Show(&blind, kLight).scope, Scope::kTrack);
}

TEST(DarkRoom, AMotionInSpaceDoesAsWell) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(&tracker, 0).has_fix());
  Matrix6d covariance = Matrix6d::Identity() * 1e-6;
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(tracker.Move({OnDrive(i + 1) * OnDrive(i).Inverse(), covariance}).ok());
    if (i < 29) ShowNothing(&tracker);
  }
  EXPECT_LT(CenterErrorM(tracker.Prediction()->cam_from_world, OnDrive(30)), 0.05);
  EXPECT_EQ(Show(&tracker, 30).scope, Scope::kTrack);
  covariance(0, 0) = -1;
  EXPECT_EQ(tracker.Move({Pose(), covariance}).error().code, ErrorCode::kInvalidArgument);
}

TEST(DarkRoom, FramesOfWhichNothingIsToldMakeItLessCertain) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(&tracker, 0).has_fix());
  ASSERT_TRUE(tracker.Move({0.1, 0}, 0).ok());
  const double told_m = tracker.Prediction()->sigma_m;
  EXPECT_LT(told_m, RegionTrackerOptions().step_sigma_m);
  EXPECT_GE(told_m, RegionTrackerOptions().min_prior_sigma_m);
  ShowNothing(&tracker);
  EXPECT_GE(tracker.Prediction()->sigma_m, RegionTrackerOptions().step_sigma_m);
}

// By odometry a prediction is as certain as the fix and the wheels, but no more than fixes are.
TEST(DarkRoom, PredictionsByOdometryAreAsCertainAsWhatTheyComeFrom) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(&tracker, 0).has_fix());
  ASSERT_TRUE(tracker.Move({0.1, 0}, 0).ok());
  EXPECT_DOUBLE_EQ(tracker.Prediction()->sigma_m, RegionTrackerOptions().min_prior_sigma_m);
  EXPECT_DOUBLE_EQ(tracker.Prediction()->sigma_deg, RegionTrackerOptions().min_prior_sigma_deg);
  Matrix6d covariance = Matrix6d::Identity() * 1e-8;
  covariance(1, 1) = RadFromDeg(7) * RadFromDeg(7);
  ASSERT_TRUE(tracker.Move({Pose(), covariance}).ok());
  EXPECT_DOUBLE_EQ(tracker.Prediction()->sigma_m, RegionTrackerOptions().min_prior_sigma_m);
  EXPECT_NEAR(tracker.Prediction()->sigma_deg, 7, 0.05);
  covariance = Matrix6d::Identity() * 1e-8;
  covariance(3, 3) = 0.4 * 0.4;
  ASSERT_TRUE(tracker.Move({Pose(), covariance}).ok());
  EXPECT_NEAR(tracker.Prediction()->sigma_m, 0.4, 0.005);
  ASSERT_TRUE(tracker.Move({Pose(), covariance}).ok());
  EXPECT_NEAR(tracker.Prediction()->sigma_m, 0.4 * std::sqrt(2), 0.005);
  ASSERT_TRUE(tracker.Move({Pose(), covariance}).ok());
  EXPECT_FALSE(tracker.Prediction()) << "0.69 m, and 0.6 are the most";
}

TEST(DarkRoom, AKidnappedRobotIsFoundThoughItsWheelsStoodStill) {
  RegionTracker tracker(RoomMap());
  ASSERT_TRUE(Show(&tracker, 0).has_fix());
  ASSERT_TRUE(tracker.Move({0, 0}, 0).ok());
  const Localization found = Show(&tracker, 60);
  ASSERT_TRUE(found.has_fix());
  EXPECT_NE(found.scope, Scope::kTrack);
  EXPECT_LT(CenterErrorM(found.cam_from_world, OnDrive(60)), 0.05);
}

TEST(DarkRoom, OdometryThatIsNoNumberOrHasNoUnitIsRefused) {
  RegionTracker tracker(RoomMap());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(tracker.Move({kNan, 0}, 0).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(tracker.Move({0, 0}, kNan).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(tracker.Prediction());
  MapRows unscaled = Room().rows;
  unscaled.frame.unit = "arbitrary";
  RegionTracker without_unit(*Map::FromRows(unscaled));
  EXPECT_EQ(without_unit.Move({1, 0}, 0).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(without_unit.Move(UncertainPose{}).ok());
}

}  // namespace
}  // namespace cairn
