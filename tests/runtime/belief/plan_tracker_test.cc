#include "runtime/belief/plan_tracker.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "runtime/scans/beam.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double kTwinM = 20;  // from one wing to the other

// Two wings of the same rooms; in the second a pillar stands at the end.
Views TwinWings() {
  Views views;
  for (const double x : {0.0, kTwinM}) {
    std::vector<PlanWall> wing = {{{0, 0}, {12, 0}}, {{12, 0}, {12, 4}}, {{12, 4}, {0, 4}},
                                  {{0, 4}, {0, 0}},  {{2, 0}, {2, 1}},   {{4, 4}, {4, 3}},
                                  {{4, 3}, {5, 3}},  {{6, 0}, {6, 1.5}}, {{7, 0}, {7, 2.8}}};
    if (x > 0) wing.push_back({{10, 2}, {11, 2.5}});
    for (PlanWall& wall : wing) {
      wall.start.x() += x;
      wall.end.x() += x;
      views.plan.walls.push_back(wall);
    }
  }
  return views;
}

class Robot {
 public:
  Robot(const Views& views, const PlanarPose& pose, const PlanTrackerOptions& options = {})
      : walls_(views.plan.walls), pose_(pose), tracker_(*PlanTracker::Make(views, options)) {}

  // Metres ahead and a turn, of which the wheels err by a twentieth.
  void Drive(double way_m, double turn_rad = 0) {
    EXPECT_TRUE(tracker_.Move({{1.05 * way_m, 0}, 0.95 * turn_rad}).ok());
    pose_ = {pose_.FloorFromRobot({way_m, 0}), WrapAngle(pose_.heading_rad + turn_rad)};
  }
  void Look() {
    RangeScan scan;
    scan.first_angle_rad = RadFromDeg(-90);
    scan.step_rad = RadFromDeg(1);
    for (const Beam& beam : BeamsAt(walls_, pose_, 0.01, &random_)) scan.ranges_m.push_back(beam.range_m);
    EXPECT_TRUE(tracker_.SeeScan(ViewOf(scan, {})).ok());
  }
  void Carry(const PlanarPose& pose) { pose_ = pose; }

  // What is believed of the places near to where it is.
  double Believed() const { return BelievedNear(pose_); }
  double BelievedNear(const PlanarPose& pose) const {
    double sum = 0;
    for (const PossiblePlace& place : tracker_.belief().places()) {
      const bool near = (place.pose.position - pose.position).norm() < 0.1 &&
                        std::abs(WrapAngle(place.pose.heading_rad - pose.heading_rad)) < 0.05;
      sum += near ? place.probability : 0;
    }
    return sum;
  }
  PlanarPose Twin() const { return {pose_.position - Vec2(kTwinM, 0), pose_.heading_rad}; }
  PlanTracker& tracker() { return tracker_; }

 private:
  std::vector<PlanWall> walls_;
  PlanarPose pose_;
  Random random_{1};
  PlanTracker tracker_;
};

TEST(PlanTracker, TheWayTellsWhichOfTwoWingsItIs) {
  const Views views = TwinWings();
  Robot robot(views, {{kTwinM + 1, 2.2}, 0});
  robot.Look();
  EXPECT_NEAR(robot.Believed(), 0.5, 0.3);
  EXPECT_NEAR(robot.BelievedNear(robot.Twin()), 0.5, 0.3);
  for (int i = 0; i < 4; ++i) {
    robot.Drive(1.6);
    robot.Look();
  }
  robot.Drive(0.2);
  robot.Look();  // the pillar
  EXPECT_GT(robot.Believed(), 0.95);
  EXPECT_LT(robot.BelievedNear(robot.Twin()), 0.05);
}

TEST(PlanTracker, StandingStillTellsNothingNew) {
  const Views views = TwinWings();
  Robot robot(views, {{1, 2.2}, 0});
  robot.Look();
  const double before = robot.Believed();
  for (int i = 0; i < 20; ++i) {
    robot.Drive(0.01, 0.01);
    robot.Look();
  }
  EXPECT_NEAR(robot.Believed(), before, 0.02);
  // Nor does trembling.
  for (int i = 0; i < 20; ++i) {
    robot.Drive(0, i % 2 == 0 ? 0.1 : -0.1);
    robot.Look();
  }
  EXPECT_NEAR(robot.Believed(), before, 0.02);
}

// A turn is told by the scans that do not count, too.
TEST(PlanTracker, NearScansCorrectThePose) {
  const Views views = TwinWings();
  Robot robot(views, {{kTwinM + 8, 2.2}, 0}, {.min_turn_deg = 40});
  robot.Look();
  robot.Drive(0.25, 0.6);
  robot.Look();
  ASSERT_FALSE(robot.tracker().belief().places().empty());
  EXPECT_GT(robot.Believed(), 0.9);
  EXPECT_LT(robot.tracker().belief().places()[0].covariance(2, 2), 1e-3);
}

TEST(PlanTracker, ARobotThatWasCarriedAwayIsFoundAgain) {
  const Views views = TwinWings();
  Robot robot(views, {{kTwinM + 8, 2.2}, 0});
  robot.Look();
  robot.Drive(0.5);
  robot.Look();
  EXPECT_GT(robot.Believed(), 0.9);
  robot.Carry({{3, 1.5}, 2});
  for (int i = 0; i < 4; ++i) {
    robot.Drive(0.4);
    robot.Look();
  }
  EXPECT_GT(robot.Believed() +
                robot.BelievedNear({robot.Twin().position + Vec2(2 * kTwinM, 0), robot.Twin().heading_rad}),
            0.9);
}

// What scans cannot tell, an image may.
TEST(PlanTracker, AnImageTellsTwinsApart) {
  const Views views = TwinWings();
  Robot robot(views, {{kTwinM + 1, 2.2}, 0});
  PossiblePlace fix;
  fix.pose = {{kTwinM + 1.05, 2.2}, 0.02};
  fix.covariance = 0.01 * Eigen::Matrix3d::Identity();
  fix.probability = 0.95;
  robot.Look();
  EXPECT_LT(robot.Believed(), 0.8);
  robot.tracker().SeeImage(std::vector{fix});
  EXPECT_GT(robot.Believed(), 0.95);
  // And the other way round.
  Robot other(views, {{kTwinM + 1, 2.2}, 0});
  other.tracker().SeeImage(std::vector{fix});
  EXPECT_NEAR(other.tracker().belief().places()[0].probability, 0.93, 0.01);
  other.Look();
  EXPECT_GT(other.Believed(), 0.98);
  // The same image again says nothing more.
  const double before = other.Believed();
  for (int i = 0; i < 5; ++i) other.tracker().SeeImage(std::vector{fix});
  EXPECT_NEAR(other.Believed(), before, 1e-9);
  other.tracker().SeeImage({});
  EXPECT_NEAR(other.Believed(), before, 1e-9);
}

TEST(PlanTracker, ErrorsOfWheelsAreBelievedHoweverOftenTheyAreRead) {
  const Views views = TwinWings();
  PlanTrackerOptions options;
  options.wheels = {.wheel_way_ratio = 0.2,
                    .wheel_way_sigma_m = 0.03,
                    .wheel_turn_ratio = 0.1,
                    .wheel_turn_sigma_deg = 3,
                    .wheel_drift_deg = 4};
  for (const int num_readings : {1, 8}) {
    PlanTracker tracker = *PlanTracker::Make(views, options);
    PossiblePlace fix;
    fix.pose = {{3, 2}, std::numbers::pi / 2};
    fix.covariance = 1e-12 * Eigen::Matrix3d::Identity();
    fix.probability = 1;
    tracker.SeeImage(std::vector{fix});
    for (int i = 0; i < num_readings; ++i)
      ASSERT_TRUE(tracker.Move({{0, 0}, RadFromDeg(-40) / num_readings}).ok());
    const double turn = 0.1 * 0.1 * RadFromDeg(20) * RadFromDeg(40);
    EXPECT_NEAR(tracker.belief().places()[0].covariance(2, 2), turn, 1e-9);
    ASSERT_TRUE(tracker.Move({{0, 0}, RadFromDeg(40)}).ok());
    for (int i = 0; i < num_readings; ++i) ASSERT_TRUE(tracker.Move({{1.0 / num_readings, 0}, 0}).ok());
    const PossiblePlace& place = tracker.belief().places()[0];
    EXPECT_TRUE(place.pose.position.isApprox(Vec2(3, 3)));
    // Along y, of each half metre; beside it a third, and what its heading erred from the beginning on.
    EXPECT_NEAR(place.covariance(1, 1), 0.2 * 0.2 * 0.5, 1e-9);
    const double heading = 2 * turn + 2 * std::pow(RadFromDeg(4), 2);
    EXPECT_NEAR(place.covariance(2, 2), heading, 1e-9);
    const double beside = 0.2 * 0.2 * 0.5 / 9 + 2 * turn;
    EXPECT_GE(place.covariance(0, 0), beside - 1e-9);
    EXPECT_LE(place.covariance(0, 0), beside + heading);
    if (num_readings > 1) continue;
    EXPECT_NEAR(place.covariance(0, 0), beside, 1e-9);
    // In any case, once a look.
    tracker.SeeImage(
        std::vector{PossiblePlace{{{{3, 3}, std::numbers::pi / 2}, 100 * Eigen::Matrix3d::Identity()}, 1}});
    EXPECT_NEAR(tracker.belief().places()[0].covariance(1, 1), 0.2 * 0.2 * 0.5 + 0.03 * 0.03, 1e-5);
    EXPECT_NEAR(tracker.belief().places()[0].covariance(2, 2), heading + std::pow(RadFromDeg(3), 2), 1e-5);
  }
}

TEST(PlanTracker, BadInputIsRefusedAndChangesNothing) {
  const Views views = TwinWings();
  Robot robot(views, {{1, 2.2}, 0});
  robot.Look();
  const double before = robot.Believed();
  EXPECT_EQ(robot.tracker().Move({{NAN, 0}, 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(robot.tracker().Move({{0, 0}, INFINITY}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(robot.tracker().SeeScan({}).error().code, ErrorCode::kNoData);
  EXPECT_EQ(robot.Believed(), before);
  EXPECT_EQ(PlanTracker::Make(views, {.min_way_m = -1}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(PlanTracker::Make(Views(), {}).error().code, ErrorCode::kNoData);
  EXPECT_TRUE(PlanTracker::Make(views, {.min_way_m = 0, .min_turn_deg = 0}).ok());
}

PossiblePlace Seen(const PlanarPose& pose, double probability) {
  PossiblePlace place;
  place.pose = pose;
  place.covariance = 0.01 * Eigen::Matrix3d::Identity();
  place.probability = probability;
  return place;
}

// Of wheels without errors: exactly so far counts.
TEST(PlanTracker, ALookCountsAfterAWayOrATurn) {
  const Views views = TwinWings();
  PlanTrackerOptions options{.min_way_m = 0.5, .min_turn_deg = 20};
  options.wheels = {0, 1e-6, 0, 1e-6, 0};
  const auto counts = [&](const FloorMotion& motion) {
    PlanTracker tracker = *PlanTracker::Make(views, options);
    tracker.SeeImage(std::vector{Seen({{3, 2}, 0}, 0.8)});
    EXPECT_TRUE(tracker.Move(motion).ok());
    const double before = tracker.belief().places()[0].probability;
    tracker.SeeImage(
        std::vector{Seen(PlanarPose{{3, 2}, 0} * PlanarPose{motion.way_m, motion.turn_left_rad}, 0.8)});
    const double after = tracker.belief().places()[0].probability;
    // From there on it is counted anew.
    tracker.SeeImage(
        std::vector{Seen(PlanarPose{{3, 2}, 0} * PlanarPose{motion.way_m, motion.turn_left_rad}, 0.8)});
    EXPECT_EQ(tracker.belief().places()[0].probability, after);
    return after != before;
  };
  EXPECT_FALSE(counts({{0, 0}, 0}));
  EXPECT_FALSE(counts({{0.49, 0}, 0}));
  EXPECT_TRUE(counts({{0.5, 0}, 0}));
  EXPECT_TRUE(counts({{0, -0.51}, 0}));
  EXPECT_FALSE(counts({{0, 0}, RadFromDeg(-19)}));
  EXPECT_TRUE(counts({{0, 0}, RadFromDeg(20)}));
  EXPECT_TRUE(counts({{0, 0}, RadFromDeg(-21)}));
}

// What a look says by itself is compared with being anywhere within the plan's walls, at least on a square
// metre.
TEST(PlanTracker, TheFloorIsAsLargeAsItsWallsReach) {
  Views thin;
  thin.plan.walls = {{{0, 0}, {3, 0}}};
  for (const auto& [views, area_m2] : {std::pair<Views, double>{TwinWings(), 32 * 4}, {thin, 1}}) {
    PlanTrackerOptions options{.min_way_m = 0};
    options.wheels = {0, 1e-6, 0, 1e-6, 0};
    PlanTracker tracker = *PlanTracker::Make(views, options);
    PoseBelief belief(area_m2);
    for (int i = 0; i < 2; ++i) {
      const std::vector<PossiblePlace> seen = {Seen({{1 + 0.1 * i, 1}, 0}, 0.3)};
      tracker.SeeImage(seen);
      belief.Update(seen);
      ASSERT_FALSE(tracker.belief().places().empty());
      EXPECT_NEAR(tracker.belief().places()[0].probability, belief.places()[0].probability, 1e-8);
    }
  }
}

}  // namespace
}  // namespace cairn
