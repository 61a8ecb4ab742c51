#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/progress.h"
#include "core/plan/views_database.h"
#include "runtime/beams/scan_locator.h"
#include "runtime/belief/robot_on_plan.h"
#include "runtime/c_api/cairn.h"
#include "runtime/localize/localizer.h"
#include "runtime/map/map.h"
#include "runtime/map/open_views.h"
#include "tests/install/c_image.h"
#include "tests/install/laser_room.h"

namespace cairn {
namespace {

using testing::HasSubstr;

const std::vector<LaserStep>& DriveByLaser() {
  static const std::vector<LaserStep> drive = LaserDrive();
  return drive;
}

// The caller's numbers; they must live as long.
cairn_scan ScanOf(const RangeScan& scan) {
  cairn_scan given = CAIRN_SCAN_INIT;
  given.num_beams = static_cast<int32_t>(scan.ranges_m.size());
  given.ranges_m = scan.ranges_m.data();
  given.angles_rad = scan.angles_rad.empty() ? nullptr : scan.angles_rad.data();
  given.first_angle_rad = scan.first_angle_rad;
  given.step_rad = scan.step_rad;
  given.max_range_m = std::isinf(scan.max_range_m) ? 0 : scan.max_range_m;
  return given;
}

// The map of a room with its plan, in C and in C++.
class CPlan : public testing::Test {
 protected:
  CPlan() : path_(testing::TempDir() + "/c_api_plan.cairn") {
    static const MapRows rows = LaserRoomRows();
    EXPECT_TRUE(WriteMapRows(rows, path_).ok());
    views_ = *OpenPlan(path_);
    EXPECT_EQ(cairn_plan_open(path_.c_str(), &plan_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_scan_locator_create(plan_, &locator_), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_plan_tracker_create(plan_, &tracker_), CAIRN_OK) << cairn_last_error();
  }
  ~CPlan() override {
    EXPECT_EQ(cairn_scan_locator_destroy(locator_), CAIRN_OK);
    EXPECT_EQ(cairn_plan_tracker_destroy(tracker_), CAIRN_OK);
    EXPECT_EQ(cairn_plan_close(plan_), CAIRN_OK);
  }

  cairn_plan_place Place(int32_t number) {
    cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
    EXPECT_EQ(cairn_plan_tracker_place(tracker_, number, &place), CAIRN_OK) << cairn_last_error();
    return place;
  }
  static void ExpectSame(const cairn_plan_place& place, const PossiblePlace& expected, bool determined) {
    EXPECT_EQ(Eigen::Vector2d(place.position_m), expected.pose.position);
    EXPECT_EQ(place.heading_rad, expected.pose.heading_rad);
    EXPECT_EQ(Eigen::Matrix3d(place.covariance), expected.covariance);
    EXPECT_EQ(place.probability, expected.probability);
    EXPECT_EQ(place.determined, determined ? 1 : 0);
  }
  // The tracker believes what another one does, to the last bit.
  void ExpectBelieves(const std::vector<PossiblePlace>& expected, double expected_elsewhere) {
    int32_t num_places = -1;
    double elsewhere = -1;
    ASSERT_EQ(cairn_plan_tracker_places(tracker_, &num_places, &elsewhere), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(num_places, static_cast<int32_t>(expected.size()));
    EXPECT_EQ(elsewhere, expected_elsewhere);
    for (int32_t i = 0; i < num_places; ++i)
      ExpectSame(Place(i), expected[i], IsDetermined(expected[i].covariance));
  }
  int32_t See(const RangeScan& scan) {
    const cairn_scan given = ScanOf(scan);
    return cairn_plan_tracker_see_scan(tracker_, &given);
  }

  std::string path_;
  std::shared_ptr<const Views> views_;
  cairn_plan* plan_ = nullptr;
  cairn_scan_locator* locator_ = nullptr;
  cairn_plan_tracker* tracker_ = nullptr;
};

TEST_F(CPlan, IsThatOfAMapOrOfAFileOfItsOwn) {
  std::array<double, 400> ends{};
  int32_t num_walls = -1;
  ASSERT_EQ(cairn_plan_walls(plan_, nullptr, 0, &num_walls), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(num_walls, static_cast<int32_t>(LaserRoomWalls().size()));
  ASSERT_EQ(cairn_plan_walls(plan_, ends.data(), 2, &num_walls), CAIRN_OK);
  EXPECT_EQ(num_walls, static_cast<int32_t>(LaserRoomWalls().size()));
  EXPECT_EQ(Eigen::Vector4d(ends.data()), Eigen::Vector4d(-5, -2.5, 3, -2.5));
  EXPECT_EQ(Eigen::Vector4d(&ends[4]), Eigen::Vector4d(3, -2.5, 3, 0.5));
  EXPECT_EQ(ends[8], 0);  // no more than there is room for

  const std::string views_path = testing::TempDir() + "/c_api_plan_views.db";
  NoProgress progress;
  ASSERT_TRUE(WriteViews(LaserRoomPlan(), views_path, progress, [](SQLite::Database&) { return Ok(); }).ok());
  cairn_plan* of_views = nullptr;
  ASSERT_EQ(cairn_plan_open(views_path.c_str(), &of_views), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_plan_walls(of_views, ends.data(), 100, &num_walls), CAIRN_OK);
  EXPECT_EQ(Eigen::Vector4d(&ends[4]), Eigen::Vector4d(3, -2.5, 3, 0.5));
  cairn_map* map = nullptr;
  cairn_plan* of_map = nullptr;
  ASSERT_EQ(cairn_map_open(path_.c_str(), nullptr, &map), CAIRN_OK);
  ASSERT_EQ(cairn_map_plan(map, &of_map), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(cairn_map_close(map), CAIRN_OK);  // the plan stays
  ASSERT_EQ(cairn_plan_walls(of_map, ends.data(), 100, &num_walls), CAIRN_OK);
  EXPECT_EQ(num_walls, static_cast<int32_t>(LaserRoomWalls().size()));
  EXPECT_EQ(cairn_plan_close(of_map), CAIRN_OK);
  EXPECT_EQ(cairn_plan_close(of_views), CAIRN_OK);
}

TEST_F(CPlan, AScanIsLocatedAsInCxxBitForBit) {
  ASSERT_EQ(cairn_plan_close(plan_), CAIRN_OK);  // the locator keeps what it needs
  plan_ = nullptr;
  const ScanLocator locator = *ScanLocator::Make(*views_, {});
  for (const LaserStep& step : DriveByLaser()) {
    const cairn_scan scan = ScanOf(step.scan);
    int32_t num_places = -1, is_complete = -1;
    ASSERT_EQ(cairn_scan_locator_locate(locator_, &scan, &num_places, &is_complete), CAIRN_OK)
        << cairn_last_error();
    const LocatedScan expected = *locator.Locate(ViewOf(step.scan, {}));
    ASSERT_EQ(num_places, static_cast<int32_t>(expected.hypotheses.size()));
    EXPECT_EQ(is_complete, expected.complete ? 1 : 0);
    for (int32_t i = 0; i < num_places; ++i) {
      const ScanHypothesis& hypothesis = expected.hypotheses[i];
      cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
      ASSERT_EQ(cairn_scan_locator_place(locator_, i, &place), CAIRN_OK) << cairn_last_error();
      ExpectSame(place, {{hypothesis.pose, hypothesis.covariance}, hypothesis.probability},
                 hypothesis.determined);
      EXPECT_EQ(place.explained_ratio, hypothesis.explained_ratio);
    }
    cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
    ASSERT_EQ(cairn_scan_locator_place(locator_, 0, &place), CAIRN_OK);
    EXPECT_LT((Eigen::Vector2d(place.position_m) - step.robot.position).norm(), 0.05);
    EXPECT_GT(place.probability, 0.9);
    EXPECT_GT(place.explained_ratio, 0.9);
    EXPECT_EQ(place.determined, 1);
  }
}

// Angles one by one are those of equal steps, and may be any.
TEST_F(CPlan, BeamsMayHaveAnglesOfTheirOwn) {
  RangeScan scan = DriveByLaser()[0].scan;
  int32_t num_places = 0;
  cairn_plan_place equal = CAIRN_PLAN_PLACE_INIT, each = CAIRN_PLAN_PLACE_INIT, other = CAIRN_PLAN_PLACE_INIT;
  cairn_scan given = ScanOf(scan);
  ASSERT_EQ(cairn_scan_locator_locate(locator_, &given, &num_places, nullptr), CAIRN_OK);
  ASSERT_EQ(cairn_scan_locator_place(locator_, 0, &equal), CAIRN_OK);
  std::vector<double> angles;
  for (size_t i = 0; i < scan.ranges_m.size(); ++i)
    angles.push_back(scan.first_angle_rad + static_cast<double>(i) * scan.step_rad);
  scan.angles_rad = angles;
  scan.first_angle_rad = scan.step_rad = std::nan("");  // not read
  given = ScanOf(scan);
  ASSERT_EQ(cairn_scan_locator_locate(locator_, &given, &num_places, nullptr), CAIRN_OK)
      << cairn_last_error();
  ASSERT_EQ(cairn_scan_locator_place(locator_, 0, &each), CAIRN_OK);
  EXPECT_EQ(Eigen::Vector2d(each.position_m), Eigen::Vector2d(equal.position_m));
  EXPECT_EQ(each.heading_rad, equal.heading_rad);
  // A laser that is turned by 0.7 rad sees the same at other angles.
  for (double& angle : scan.angles_rad) angle -= 0.7;
  given = ScanOf(scan);
  ASSERT_EQ(cairn_scan_locator_locate(locator_, &given, &num_places, nullptr), CAIRN_OK);
  ASSERT_EQ(cairn_scan_locator_place(locator_, 0, &other), CAIRN_OK);
  EXPECT_NEAR(other.heading_rad, equal.heading_rad + 0.7, 0.01);
  EXPECT_NEAR(other.position_m[0], equal.position_m[0], 0.02);
}

TEST_F(CPlan, ARobotIsFollowedAsInCxxBitForBit) {
  ASSERT_EQ(cairn_plan_close(plan_), CAIRN_OK);
  plan_ = nullptr;
  PlanTracker tracker = *PlanTracker::Make(*views_, {});
  int32_t num_places = -1;
  double elsewhere = -1;
  ASSERT_EQ(cairn_plan_tracker_places(tracker_, &num_places, &elsewhere), CAIRN_OK);
  EXPECT_EQ(num_places, 0);  // anywhere
  EXPECT_EQ(elsewhere, 1);
  for (size_t i = 0; i < DriveByLaser().size(); ++i) {
    const LaserStep& step = DriveByLaser()[i];
    if (i > 0) {
      ASSERT_EQ(cairn_plan_tracker_move(tracker_, step.moved.way_m.x(), step.moved.way_m.y(),
                                        step.moved.turn_left_rad),
                CAIRN_OK)
          << cairn_last_error();
      ASSERT_TRUE(tracker.Move(step.moved).ok());
      ExpectBelieves(tracker.belief().places(), tracker.belief().elsewhere());
    }
    ASSERT_EQ(See(step.scan), CAIRN_OK) << cairn_last_error();
    ASSERT_TRUE(tracker.SeeScan(ViewOf(step.scan, {})).ok());
    ExpectBelieves(tracker.belief().places(), tracker.belief().elsewhere());
  }
  const cairn_plan_place place = Place(0);
  EXPECT_LT((Eigen::Vector2d(place.position_m) - DriveByLaser().back().robot.position).norm(), 0.05);
  EXPECT_NEAR(place.heading_rad, DriveByLaser().back().robot.heading_rad, 0.02);
  EXPECT_GT(place.probability, 0.99);
  EXPECT_EQ(place.explained_ratio, 0);
}

// By poses in a frame of the wheels' that lies anywhere.
TEST_F(CPlan, PosesOfWheelsMoveItAsTheirDifferences) {
  PlanarPose wheels{{30, -7}, 2.5};
  RobotOnPlan robot = *RobotOnPlan::Make(views_);
  for (const LaserStep& step : DriveByLaser()) {
    wheels = wheels * PlanarPose{step.moved.way_m, step.moved.turn_left_rad};
    ASSERT_EQ(
        cairn_plan_tracker_move_to(tracker_, wheels.position.x(), wheels.position.y(), wheels.heading_rad),
        CAIRN_OK)
        << cairn_last_error();
    ASSERT_TRUE(robot.MoveTo(wheels).ok());
    ASSERT_EQ(See(step.scan), CAIRN_OK);
    ASSERT_TRUE(robot.SeeScan(step.scan).ok());
    ExpectBelieves(robot.Places(), robot.elsewhere());
  }
  EXPECT_LT((Eigen::Vector2d(Place(0).position_m) - DriveByLaser().back().robot.position).norm(), 0.05);
}

// A laser behind the axle that looks back: places and motions are the robot's.
TEST_F(CPlan, WhereTheLaserStandsOnTheRobotCounts) {
  for (const auto& [name, value] :
       {std::pair("laser_ahead_m", "-0.3"), {"laser_left_m", "0.2"}, {"laser_turn_deg", "170"}})
    ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, name, value), CAIRN_OK) << cairn_last_error();
  const PlanarPose robot_from_laser{{-0.3, 0.2}, RadFromDeg(170)};
  Random random(3);
  PlanarPose robot{{-4, 0}, 0};
  for (int i = 0; i < 4; ++i) {
    if (i > 0) {
      ASSERT_EQ(cairn_plan_tracker_move(tracker_, 0.3, 0, 0.3), CAIRN_OK);
      robot = robot * PlanarPose{{0.3, 0}, 0.3};
      // By the wheels alone it is there already, from where it was.
      EXPECT_LT((Eigen::Vector2d(Place(0).position_m) - robot.position).norm(), 0.03) << i;
    }
    ASSERT_EQ(See(LaserScanAt(robot * robot_from_laser, &random)), CAIRN_OK) << cairn_last_error();
    EXPECT_LT((Eigen::Vector2d(Place(0).position_m) - robot.position).norm(), 0.03) << i;
    EXPECT_NEAR(Place(0).heading_rad, robot.heading_rad, 0.02) << i;
    EXPECT_GT(Place(0).probability, 0.8);
  }
}

TEST_F(CPlan, ImagesAndScansAreBelievedTogether) {
  cairn_map* map = nullptr;
  cairn_localizer* localizer = nullptr;
  ASSERT_EQ(cairn_map_open(path_.c_str(), nullptr, &map), CAIRN_OK);
  ASSERT_EQ(cairn_localizer_create(map, &localizer), CAIRN_OK);
  const std::shared_ptr<const Map> same_map = *Map::Open(path_);
  Localizer same_localizer(same_map);
  RobotOnPlan robot = *RobotOnPlan::Make(views_, {.camera_ahead_m = 0.4});
  ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, "camera_ahead_m", "0.4"), CAIRN_OK) << cairn_last_error();
  const cv::Mat picture = PosterRoom().PictureAt(-3.6);
  const cairn_image image = ImageOf(picture);
  cairn_fix fix = CAIRN_FIX_INIT;
  ASSERT_EQ(cairn_plan_tracker_see_image(tracker_, localizer, &image, nullptr, &fix), CAIRN_OK)
      << cairn_last_error();
  EXPECT_EQ(fix.has_fix, 1);
  const Localization found =
      *same_localizer.Localize(picture, *same_map->CameraForSize(picture.cols, picture.rows));
  EXPECT_EQ(fix.probability, found.probability);
  ASSERT_TRUE(robot.SeeImage(found, same_map->head()).ok());
  ExpectBelieves(robot.Places(), robot.elsewhere());
  // Its camera is 0.4 m ahead of it.
  EXPECT_NEAR(Place(0).position_m[0], -4, 0.05);
  EXPECT_NEAR(Place(0).position_m[1], 0, 0.05);
  EXPECT_GT(Place(0).probability, 0.5);
  Random random(1);
  const RangeScan scan = LaserScanAt({{-4, 0}, 0}, &random);
  ASSERT_EQ(See(scan), CAIRN_OK) << cairn_last_error();
  ASSERT_TRUE(robot.SeeScan(scan).ok());
  ExpectBelieves(robot.Places(), robot.elsewhere());
  EXPECT_GT(Place(0).probability, 0.99);

  // The same fix by itself says the same; none changes nothing.
  ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, "camera_ahead_m", "0.4"), CAIRN_OK);  // anew
  ASSERT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &fix), CAIRN_OK) << cairn_last_error();
  EXPECT_NEAR(Place(0).position_m[0], -4, 0.05);
  const double before = Place(0).probability;
  cairn_fix none = CAIRN_FIX_INIT;
  ASSERT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &none), CAIRN_OK);
  EXPECT_EQ(Place(0).probability, before);
  const cv::Mat blank(240, 320, CV_8UC1, cv::Scalar(90));
  const cairn_image dark = ImageOf(blank);
  ASSERT_EQ(cairn_plan_tracker_see_image(tracker_, localizer, &dark, nullptr, nullptr), CAIRN_OK);
  EXPECT_EQ(Place(0).probability, before);

  cairn_fix bad = fix;
  bad.rotation_wxyz[0] = 7;
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &bad), CAIRN_INVALID_ARGUMENT);
  bad = fix;
  bad.covariance[0] = std::nan("");
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &bad), CAIRN_INVALID_ARGUMENT);
  bad = fix;
  bad.probability = 1.5;
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &bad), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("probability is 1.5"));
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, nullptr, &fix), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, map, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_see_image(tracker_, nullptr, &image, nullptr, &fix), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(fix.has_fix, 0);
  EXPECT_EQ(cairn_plan_tracker_see_image(tracker_, localizer, nullptr, nullptr, nullptr),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(Place(0).probability, before);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

TEST_F(CPlan, AMapWithoutMetresHasNoWordOnAPlan) {
  MapRows rows = PosterRoom().rows();
  rows.frame.unit = "arbitrary";
  const std::string path = testing::TempDir() + "/c_api_plan_unit.cairn";
  ASSERT_TRUE(WriteMapRows(rows, path).ok());
  cairn_map* map = nullptr;
  cairn_plan* none = plan_;
  ASSERT_EQ(cairn_map_open(path.c_str(), nullptr, &map), CAIRN_OK);
  cairn_fix fix = CAIRN_FIX_INIT;
  EXPECT_EQ(cairn_plan_tracker_see_fix(tracker_, map, &fix), CAIRN_UNSUPPORTED);
  EXPECT_THAT(cairn_last_error(), HasSubstr("metre"));
  EXPECT_EQ(cairn_map_plan(map, &none), CAIRN_NOT_FOUND);
  EXPECT_EQ(none, nullptr);
  EXPECT_EQ(cairn_plan_open(path.c_str(), &none), CAIRN_NOT_FOUND);
  EXPECT_THAT(cairn_last_error(), HasSubstr(path));
  EXPECT_EQ(cairn_map_close(map), CAIRN_OK);
}

// A beacon that says that it is at one of two places.
TEST_F(CPlan, OtherSensesSayTheirPlaces) {
  cairn_plan_place a = CAIRN_PLAN_PLACE_INIT, b = CAIRN_PLAN_PLACE_INIT;
  a.position_m[0] = -4;
  a.probability = 0.6;
  b.position_m[0] = 1;
  b.heading_rad = 3;
  b.probability = 0.3;
  for (cairn_plan_place* place : {&a, &b})
    for (int i = 0; i < 3; ++i) place->covariance[4 * i] = 0.01;
  const cairn_plan_place* both[] = {&a, &b};
  ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, "laser_ahead_m", "0.5"), CAIRN_OK);
  ASSERT_EQ(cairn_plan_tracker_see_places(tracker_, both, 2), CAIRN_OK) << cairn_last_error();
  EXPECT_NEAR(Place(0).position_m[0], -4, 1e-9);
  EXPECT_NEAR(Place(0).probability, 0.6, 0.02);
  EXPECT_NEAR(Place(1).position_m[0], 1, 1e-9);
  EXPECT_NEAR(Place(1).heading_rad, 3, 1e-9);
  EXPECT_NEAR(Place(1).covariance[8], 0.01, 1e-9);
  ASSERT_EQ(cairn_plan_tracker_see_places(tracker_, nullptr, 0), CAIRN_OK);
  const auto refuse = [&](const char* words) {
    EXPECT_EQ(cairn_plan_tracker_see_places(tracker_, both, 2), CAIRN_INVALID_ARGUMENT);
    EXPECT_THAT(cairn_last_error(), HasSubstr(words));
    EXPECT_NEAR(Place(0).probability, 0.6, 0.02);
  };
  const cairn_plan_place good = b;
  b.probability = 0.5;
  refuse("sum to 1.1");
  b.probability = -0.1;
  refuse("place 1 has a probability of -0.1");
  b = good;
  b.covariance[1] = 0.005;
  refuse("not symmetric");
  b = good;
  b.covariance[8] = -1;
  refuse("no variance");
  b = good;
  b.heading_rad = std::nan("");
  refuse("place 1 has a number that is not finite");
  b = good;
  b.size = 8;
  refuse("place->size is 8");
  both[1] = nullptr;
  refuse("place is NULL");
  EXPECT_EQ(cairn_plan_tracker_see_places(tracker_, both, -1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_see_places(tracker_, nullptr, 1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_see_places(tracker_, both, 1 << 30), CAIRN_INVALID_ARGUMENT);
}

TEST_F(CPlan, ScansThatCannotBeAreRefusedAndChangeNothing) {
  const RangeScan& good = DriveByLaser()[0].scan;
  ASSERT_EQ(See(good), CAIRN_OK);
  const cairn_plan_place before = Place(0);
  const auto refuse = [&](const cairn_scan* scan, int32_t code, const char* words) {
    int32_t num_places = 7, is_complete = 7;
    EXPECT_EQ(cairn_scan_locator_locate(locator_, scan, &num_places, &is_complete), code);
    EXPECT_THAT(cairn_last_error(), HasSubstr(words));
    EXPECT_EQ(num_places, 0);
    cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
    EXPECT_EQ(cairn_scan_locator_place(locator_, 0, &place), CAIRN_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_plan_tracker_see_scan(tracker_, scan), code);
    EXPECT_THAT(cairn_last_error(), HasSubstr(words));
    EXPECT_EQ(Place(0).probability, before.probability);
    EXPECT_EQ(Place(0).position_m[0], before.position_m[0]);
  };
  refuse(nullptr, CAIRN_INVALID_ARGUMENT, "scan is NULL");
  cairn_scan scan = ScanOf(good);
  scan.size = 8;
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "scan->size is 8");
  for (const int32_t num_beams : {0, -1, 100001, std::numeric_limits<int32_t>::max()}) {
    scan = ScanOf(good);
    scan.num_beams = num_beams;
    refuse(&scan, CAIRN_INVALID_ARGUMENT, "num_beams is");
  }
  scan = ScanOf(good);
  scan.ranges_m = nullptr;
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "ranges_m is NULL");
  scan = ScanOf(good);
  scan.max_range_m = -1;
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "largest range of a scan is -1");
  scan.max_range_m = std::nan("");
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "largest range of a scan is nan");
  scan = ScanOf(good);
  scan.step_rad = 0;
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "what is the step");
  scan.step_rad = 2;  // degrees
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "are the angles degrees?");
  scan.step_rad = std::nan("");
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "angle of beam 0");
  std::vector<double> angles(good.ranges_m.size(), 1);
  angles[3] = HUGE_VAL;
  scan.angles_rad = angles.data();
  refuse(&scan, CAIRN_INVALID_ARGUMENT, "angle of beam 3 of a scan is inf");
  // Ranges that say nothing are no beams.
  for (const double range : {-1.0, 0.0, std::nan(""), -HUGE_VAL, HUGE_VAL}) {
    const std::vector<double> ranges(180, range);
    scan = ScanOf(good);
    scan.ranges_m = ranges.data();
    refuse(&scan, CAIRN_NO_DATA, "0 of");
  }
  std::vector<double> some = good.ranges_m;
  for (size_t i = 0; i < some.size(); i += 9) some[i] = i % 2 == 0 ? -3 : std::nan("");
  scan = ScanOf(good);
  scan.ranges_m = some.data();
  int32_t num_places = 0;
  EXPECT_EQ(cairn_scan_locator_locate(locator_, &scan, &num_places, nullptr), CAIRN_OK);
  EXPECT_GT(num_places, 0);
}

TEST_F(CPlan, MotionsThatAreNotFiniteAreRefused) {
  EXPECT_EQ(cairn_plan_tracker_move(tracker_, std::nan(""), 0, 0), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_move(tracker_, 0, 0, HUGE_VAL), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_move_to(tracker_, 0, 0, std::nan("")), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("not finite"));
  // The one that was refused is not where the wheels were.
  ASSERT_EQ(See(DriveByLaser()[0].scan), CAIRN_OK);
  const double x = Place(0).position_m[0];
  ASSERT_EQ(cairn_plan_tracker_move_to(tracker_, 100, 50, 1), CAIRN_OK);
  EXPECT_EQ(cairn_plan_tracker_move_to(tracker_, HUGE_VAL, 50, 1), CAIRN_INVALID_ARGUMENT);
  ASSERT_EQ(cairn_plan_tracker_move_to(tracker_, 100, 50, 1), CAIRN_OK);
  EXPECT_NEAR(Place(0).position_m[0], x, 1e-9);
}

TEST_F(CPlan, OptionsAreThoseThatAreReadAndBeginAnew) {
  ASSERT_EQ(See(DriveByLaser()[0].scan), CAIRN_OK);
  const auto num_places = [&] {
    int32_t num = -1;
    EXPECT_EQ(cairn_plan_tracker_places(tracker_, &num, nullptr), CAIRN_OK);
    return num;
  };
  EXPECT_EQ(cairn_plan_tracker_set_option(tracker_, "surprise_rato", "0.1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("'surprise_ratio'"));
  EXPECT_EQ(cairn_plan_tracker_set_option(tracker_, "laser_turn_deg", "200"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_set_option(tracker_, "search", "vir"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("regions"));
  EXPECT_EQ(cairn_plan_tracker_set_option(tracker_, "min_num_inliers", "9"), CAIRN_INVALID_ARGUMENT);
  EXPECT_GT(num_places(), 0);  // as before
  ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, "max_num_places", "1"), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(num_places(), 0);  // anew
  ASSERT_EQ(See(DriveByLaser()[0].scan), CAIRN_OK);
  EXPECT_EQ(num_places(), 1);
  // Beams of more than this met nothing: then too few met something.
  ASSERT_EQ(cairn_plan_tracker_set_option(tracker_, "max_range_m", "0.1"), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(See(DriveByLaser()[0].scan), CAIRN_NO_DATA);
  const cairn_scan scan = ScanOf(DriveByLaser()[0].scan);
  int32_t num = 0;
  ASSERT_EQ(cairn_scan_locator_set_option(locator_, "max_range_m", "0.1"), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(cairn_scan_locator_locate(locator_, &scan, &num, nullptr), CAIRN_NO_DATA);
  EXPECT_EQ(cairn_scan_locator_set_option(locator_, "max_range_m", "-1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_set_option(locator_, "surprise_ratio", "0.1"), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("plan locate"));
}

TEST_F(CPlan, HandlesAndStructsAreChecked) {
  cairn_plan* plan = plan_;
  EXPECT_EQ(cairn_plan_open(nullptr, &plan), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(plan, nullptr);
  EXPECT_EQ(cairn_plan_open(path_.c_str(), nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_open("/nowhere/plan.db", &plan), CAIRN_NOT_FOUND);
  EXPECT_THAT(cairn_last_error(), HasSubstr("/nowhere/plan.db"));
  EXPECT_EQ(cairn_map_plan(nullptr, &plan), CAIRN_INVALID_ARGUMENT);
  int32_t num = 0;
  EXPECT_EQ(cairn_plan_walls(nullptr, nullptr, 0, &num), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_walls(plan_, nullptr, 3, &num), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_walls(plan_, nullptr, -1, &num), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_walls(plan_, nullptr, 0, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_close(nullptr), CAIRN_OK);

  cairn_scan_locator* locator = locator_;
  EXPECT_EQ(cairn_scan_locator_create(nullptr, &locator), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(locator, nullptr);
  EXPECT_EQ(cairn_scan_locator_create(plan_, nullptr), CAIRN_INVALID_ARGUMENT);
  const cairn_scan scan = ScanOf(DriveByLaser()[0].scan);
  EXPECT_EQ(cairn_scan_locator_locate(nullptr, &scan, &num, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_locate(locator_, &scan, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_locate(reinterpret_cast<cairn_scan_locator*>(tracker_), &scan, &num, nullptr),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("not a scan locator"));
  EXPECT_EQ(cairn_scan_locator_locate(locator_, &scan, &num, nullptr), CAIRN_OK);
  cairn_plan_place place = CAIRN_PLAN_PLACE_INIT;
  EXPECT_EQ(cairn_scan_locator_place(locator_, num, &place), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_place(locator_, -1, &place), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_place(locator_, 0, nullptr), CAIRN_INVALID_ARGUMENT);
  place.size = 16;
  EXPECT_EQ(cairn_scan_locator_place(locator_, 0, &place), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("place->size is 16"));

  cairn_plan_tracker* tracker = tracker_;
  EXPECT_EQ(cairn_plan_tracker_create(nullptr, &tracker), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(tracker, nullptr);
  EXPECT_EQ(cairn_plan_tracker_create(plan_, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_place(tracker_, 0, &place), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_places(tracker_, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_set_option(tracker_, nullptr, "1"), CAIRN_INVALID_ARGUMENT);
  ASSERT_EQ(cairn_plan_tracker_create(plan_, &tracker), CAIRN_OK);
  ASSERT_EQ(cairn_plan_tracker_destroy(tracker), CAIRN_OK);
  EXPECT_EQ(cairn_plan_tracker_destroy(tracker), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_plan_tracker_move(tracker, 0, 0, 0), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("destroyed"));
  ASSERT_EQ(cairn_plan_open(path_.c_str(), &plan), CAIRN_OK);
  ASSERT_EQ(cairn_plan_close(plan), CAIRN_OK);
  EXPECT_EQ(cairn_plan_close(plan), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_scan_locator_create(plan, &locator), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("not a plan"));
}

TEST_F(CPlan, TwoThreadsAtOnceAreBusy) {
  std::atomic<int> num_ok = 0, num_busy = 0, num_other = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int repeat = 0; repeat < 5; ++repeat) {
        const int32_t code = See(DriveByLaser()[0].scan);
        ++(code == CAIRN_OK ? num_ok : code == CAIRN_BUSY ? num_busy : num_other);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GT(num_ok, 0);
  EXPECT_GT(num_busy, 0);
  EXPECT_EQ(num_other, 0);
}

}  // namespace
}  // namespace cairn
