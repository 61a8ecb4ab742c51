#include "sim/survey/survey.h"

#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace cairn::sim {
namespace {

SimulateOptions CoarseTexels() {
  SimulateOptions options;
  options.texel_m = 0.03;
  return options;
}

TEST(MakePose, LooksAlongItsHeadingWithTheSkyAbove) {
  const Pose pose = MakePose({1, 2, 3}, RadFromDeg(90));
  EXPECT_TRUE(pose.Center().isApprox(Eigen::Vector3d(1, 2, 3), 1e-12));
  EXPECT_TRUE(pose.ViewingDirection().isApprox(Eigen::Vector3d(0, 1, 0), 1e-12));
  EXPECT_TRUE(
      (pose.rotation * Eigen::Vector3d::UnitZ()).isApprox(-Eigen::Vector3d::UnitY(), 1e-12));  // y is down
  EXPECT_TRUE((pose.rotation * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitX(), 1e-12));
  const Pose up = MakePose({0, 0, 0}, 0, RadFromDeg(30));
  EXPECT_NEAR(up.ViewingDirection().z(), 0.5, 1e-12);
  // Rolled clockwise, what is above appears to the left.
  const Pose rolled = MakePose({0, 0, 0}, 0, 0, RadFromDeg(30));
  EXPECT_LT((rolled.rotation * Eigen::Vector3d::UnitZ()).x(), -0.49);
}

TEST(PlanSurvey, ADriveReadByRowsGoesOnWhileItIsRead) {
  SimulateOptions options = CoarseTexels();
  options.survey = "driven";
  options.readout_ratio = 0.4;
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  ASSERT_GT(survey.images.size(), 10U);
  for (size_t i = 1; i + 1 < survey.images.size(); ++i) {
    const PlannedImage& image = survey.images[i];
    // Twice 0.4 of the mean motion leads from the image before to 0.8 of the way to the one after.
    const Pose motion = survey.images[i + 1].cam_from_world * survey.images[i - 1].cam_from_world.Inverse();
    const Eigen::AngleAxisd turn(motion.rotation);
    EXPECT_LT((image.readout_turn - 0.2 * turn.angle() * turn.axis()).norm(), 1e-9);
    EXPECT_LT((image.readout_way - 0.2 * motion.translation).norm(), 1e-9);
  }
  for (const PlannedImage& query : survey.queries) EXPECT_TRUE(query.readout_way.isZero(0));
  options.readout_ratio = 0;
  const Survey at_once = *PlanSurvey(building, options, 0);
  for (const PlannedImage& image : at_once.images)
    EXPECT_TRUE(image.readout_turn.isZero(0) && image.readout_way.isZero(0));
}

TEST(PlanSurvey, ACameraOfARigMovesAsTheRigDoes) {
  SimulateOptions options = CoarseTexels();
  options.survey = "driven";
  options.readout_ratio = 0.5;
  options.rig_num_cameras = 3;
  options.rig_radius_m = 0.5;
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  const size_t num = survey.images.size() / 3;
  for (size_t i = 1; i + 1 < num; ++i) {
    const auto motion = [&](size_t k) {  // while the image is read, small: to first order
      const PlannedImage& image = survey.images[k * num + i];
      return Pose{Eigen::Quaterniond(
                      Eigen::AngleAxisd(1e-4 * image.readout_turn.norm(), image.readout_turn.normalized())),
                  1e-4 * image.readout_way};
    };
    if (survey.images[i].readout_turn.isZero(0)) continue;
    for (size_t k = 1; k < 3; ++k) {
      const Pose& cam_from_rig = survey.cams_from_rig[k];
      const Pose expected = cam_from_rig * motion(0) * cam_from_rig.Inverse();
      EXPECT_LT((motion(k).translation - expected.translation).norm(), 1e-8);
      EXPECT_LT(motion(k).rotation.angularDistance(expected.rotation), 1e-7);
    }
  }
}

TEST(TakeImage, EachRowIsSeenFromWhereTheCameraIsThen) {
  const SimulateOptions options = CoarseTexels();
  const Building building = *MakeBuilding(options, 0);
  Survey survey = *PlanSurvey(building, options, 0);
  PlannedImage image = survey.images[3];
  image.readout_turn = {0.01, -0.08, 0.02};
  image.readout_way = {0.05, 0, -0.1};
  const Renderer renderer(building, survey.camera);
  image.noise = 0;
  const cv::Mat taken = TakeImage(renderer, image, 0);
  for (const int row : {0, 120, 239, 360, 479}) {
    const double part = (row + 0.5) / 480 - 0.5;
    Pose pose = image.cam_from_world;
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(part * image.readout_turn.norm(), image.readout_turn.normalized()));
    pose = Pose{turn, part * image.readout_way} * pose;
    PlannedImage still = image;
    still.cam_from_world = pose;
    still.readout_turn.setZero();
    still.readout_way.setZero();
    cv::Mat difference;
    cv::absdiff(taken.row(row), TakeImage(renderer, still, 0).row(row), difference);
    EXPECT_LT(cv::countNonZero(difference > 2), 10) << row;  // edges know the rows beside
  }
}

TEST(PlanSurvey, PutsStationsOnTheLatticeInFreeSpace) {
  const SimulateOptions options = CoarseTexels();
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  ASSERT_EQ(survey.images.size(), 4 * survey.stations.size());
  EXPECT_GE(survey.stations.size(), 110u);
  EXPECT_LE(survey.stations.size(), 160u);
  for (const Eigen::Vector2d& station : survey.stations) {
    for (const double coordinate : {station.x(), station.y()}) {
      const double steps = coordinate / options.spacing_m - 0.5;
      EXPECT_NEAR(steps, std::round(steps), 1e-9);
    }
    EXPECT_GE(ClearanceM(building, station.x(), station.y()), options.clearance_m);
    for (const Rect& obstacle : building.obstacles)
      EXPECT_GT(DistanceToRect(obstacle, station.x(), station.y()), 0);
  }
  std::set<std::string> names;
  for (size_t i = 0; i < survey.images.size(); ++i) {
    const PlannedImage& image = survey.images[i];
    names.insert(image.name);
    const Eigen::Vector3d centre = image.cam_from_world.Center();
    EXPECT_TRUE(centre.isApprox(
        Eigen::Vector3d(survey.stations[i / 4].x(), survey.stations[i / 4].y(), options.camera_height_m),
        1e-9));
    const double heading = static_cast<double>(i % 4) * std::numbers::pi / 2;
    EXPECT_TRUE(image.cam_from_world.ViewingDirection().isApprox(
        Eigen::Vector3d(std::cos(heading), std::sin(heading), 0), 1e-9));
  }
  EXPECT_EQ(names.size(), survey.images.size());
  EXPECT_EQ(survey.images.front().name, "s000_h0.jpg");
}

// A robot can go from nearly any station of the demo to any other by steps along the lattice; a few stand in
// corners that are reached in between only.
TEST(PlanSurvey, ConnectsTheStationsOfTheDemo) {
  const SimulateOptions options = CoarseTexels();
  const Survey survey = *PlanSurvey(*MakeBuilding(options, 0), options, 0);
  std::vector<size_t> stack = {0};
  std::set<size_t> reached = {0};
  while (!stack.empty()) {
    const Eigen::Vector2d here = survey.stations[stack.back()];
    stack.pop_back();
    for (size_t s = 0; s < survey.stations.size(); ++s) {
      if ((survey.stations[s] - here).norm() < 1.01 * options.spacing_m && reached.insert(s).second)
        stack.push_back(s);
    }
  }
  EXPECT_GE(reached.size(), 0.95 * static_cast<double>(survey.stations.size()));
}

TEST(PlanSurvey, AsksFromFreePlacesOffTheLattice) {
  const SimulateOptions options = CoarseTexels();
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  ASSERT_EQ(survey.queries.size(), 93u);
  for (const PlannedImage& query : survey.queries) {
    const Eigen::Vector3d centre = query.cam_from_world.Center();
    EXPECT_GE(ClearanceM(building, centre.x(), centre.y()), options.clearance_m);
    double nearest = 1e9;
    for (const Eigen::Vector2d& station : survey.stations)
      nearest = std::min(nearest, (station - centre.head<2>()).norm());
    EXPECT_GT(nearest, 0.05);
    EXPECT_LT(nearest, 0.5);
  }
}

TEST(PlanSurvey, KeepsToThePartOfTheFloorAskedFor) {
  SimulateOptions options = CoarseTexels();
  options.width_m = 8, options.depth_m = 9.3, options.num_rooms = 2, options.corridor_width_m = 5;
  options.spacing_m = 0.25;
  options.survey_area_m = {0.8, 3.3, 7.0, 6.2};
  options.query_headings = "surveyed";
  const Survey survey = *PlanSurvey(*MakeBuilding(options, 0), options, 0);
  EXPECT_EQ(survey.stations.size(), 25u * 12u);
  for (const PlannedImage& query : survey.queries) {
    const Eigen::Vector3d centre = query.cam_from_world.Center();
    EXPECT_TRUE(centre.x() >= 0.8 && centre.x() <= 7 && centre.y() >= 3.3 && centre.y() <= 6.2);
    const Eigen::Vector3d forward = query.cam_from_world.ViewingDirection();
    const double quarters = std::atan2(forward.y(), forward.x()) / (std::numbers::pi / 2);
    EXPECT_NEAR(quarters, std::round(quarters), 0.01);  // as level as rolled and pitched cameras are
  }
  for (const std::vector<double>& bad : {std::vector<double>{1, 2, 3}, {3, 1, 1, 2}, {20, 20, 21, 21}}) {
    options.survey_area_m = bad;
    const Result<Survey> none = PlanSurvey(*MakeBuilding(CoarseTexels(), 0), options, 0);
    ASSERT_FALSE(none.ok());
    EXPECT_NE(none.error().message.find("survey_area_m"), std::string::npos);
  }
}

TEST(PlanSurvey, SpoilsOnlyQueriesWithExposureAndBlur) {
  const SimulateOptions options = CoarseTexels();
  const Survey survey = *PlanSurvey(*MakeBuilding(options, 0), options, 0);
  for (const PlannedImage& image : survey.images) {
    EXPECT_EQ(image.gain, 1);
    EXPECT_EQ(image.bias, 0);
    EXPECT_EQ(image.turn.norm(), 0);
    EXPECT_EQ(image.noise, options.image_noise);
    EXPECT_EQ(RotationErrorDeg(image.cam_from_world, image.stated_cam_from_world), 0);
  }
  double least_gain = 2, greatest_gain = 0, greatest_blur_px = 0;
  for (const PlannedImage& query : survey.queries) {
    least_gain = std::min(least_gain, query.gain);
    greatest_gain = std::max(greatest_gain, query.gain);
    greatest_blur_px = std::max(greatest_blur_px, query.turn.norm() * 320);
    EXPECT_EQ(query.noise, options.query_noise);
  }
  EXPECT_LT(least_gain, 0.85);
  EXPECT_GT(greatest_gain, 1.15);
  EXPECT_GT(greatest_blur_px, 2);
  EXPECT_LE(greatest_blur_px, options.query_blur_px);
}

TEST(PlanSurvey, StatesPosesWithTheNoiseAskedFor) {
  SimulateOptions options = CoarseTexels();
  options.pose_noise_m = 0.02;
  options.pose_noise_deg = 1;
  const Survey survey = *PlanSurvey(*MakeBuilding(options, 0), options, 0);
  double squared_m = 0, squared_deg = 0;
  for (const PlannedImage& image : survey.images) {
    squared_m += std::pow(CenterErrorM(image.cam_from_world, image.stated_cam_from_world), 2);
    squared_deg += std::pow(RotationErrorDeg(image.cam_from_world, image.stated_cam_from_world), 2);
  }
  const double n = static_cast<double>(survey.images.size());
  EXPECT_NEAR(std::sqrt(squared_m / n / 3), 0.02, 0.002);
  EXPECT_NEAR(std::sqrt(squared_deg / n / 3), 1, 0.1);
  for (const PlannedImage& query : survey.queries) {
    EXPECT_EQ(CenterErrorM(query.cam_from_world, query.stated_cam_from_world), 0);
  }
}

TEST(PlanSurvey, DrivesThroughAllRooms) {
  SimulateOptions options = CoarseTexels();
  options.survey = "driven";
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const Building building = *MakeBuilding(options, seed);
    const Result<Survey> survey = PlanSurvey(building, options, seed);
    ASSERT_TRUE(survey.ok()) << survey.error().message;
    EXPECT_EQ(survey->images.front().name, "d0000.jpg");
    std::set<std::string> visited;
    for (size_t i = 0; i < survey->images.size(); ++i) {
      const Eigen::Vector3d centre = survey->images[i].cam_from_world.Center();
      EXPECT_GE(ClearanceM(building, centre.x(), centre.y()), options.clearance_m);
      for (const Room& room : building.layout.rooms) {
        if (DistanceToRect(room.rect, centre.x(), centre.y()) == 0) visited.insert(room.name);
      }
      if (i == 0) continue;
      EXPECT_LT(CenterErrorM(survey->images[i - 1].cam_from_world, survey->images[i].cam_from_world),
                3 * options.step_m);
      EXPECT_LT(RotationErrorDeg(survey->images[i - 1].cam_from_world, survey->images[i].cam_from_world), 26);
    }
    EXPECT_EQ(visited.size(), building.layout.rooms.size()) << "seed " << seed;
  }
}

TEST(PlanSurvey, ADriveLikeAFilmTurnsLittleBetweenTwoImages) {
  SimulateOptions options = CoarseTexels();
  options.survey = "driven";
  options.num_queries = 0;
  const Building building = *MakeBuilding(options, 1);
  const size_t num_images = PlanSurvey(building, options, 1)->images.size();
  options.max_turn_deg = 2;
  const Survey survey = *PlanSurvey(building, options, 1);
  EXPECT_GT(survey.images.size(), num_images);
  for (size_t i = 1; i < survey.images.size(); ++i) {
    EXPECT_LT(RotationErrorDeg(survey.images[i - 1].cam_from_world, survey.images[i].cam_from_world), 2.01);
  }
}

TEST(PlanSurvey, AnotherRunDrivesElsewhereThroughAllRooms) {
  SimulateOptions options = CoarseTexels();
  options.survey = "driven";
  options.num_queries = 0;
  const Building building = *MakeBuilding(options, 1);
  const Survey first = *PlanSurvey(building, options, 1);
  options.run = 1;
  const Survey second = *PlanSurvey(building, options, 7);
  std::set<std::string> visited;
  double farthest_m = 0;
  for (const PlannedImage& image : second.images) {
    const Eigen::Vector3d centre = image.cam_from_world.Center();
    EXPECT_GE(ClearanceM(building, centre.x(), centre.y()), options.clearance_m);
    for (const Room& room : building.layout.rooms) {
      if (DistanceToRect(room.rect, centre.x(), centre.y()) == 0) visited.insert(room.name);
    }
    double nearest_m = 1e9;
    for (const PlannedImage& other : first.images) {
      nearest_m = std::min(nearest_m, CenterErrorM(image.cam_from_world, other.cam_from_world));
    }
    farthest_m = std::max(farthest_m, nearest_m);
  }
  EXPECT_EQ(visited.size(), building.layout.rooms.size());
  EXPECT_GT(farthest_m, 2 * options.step_m);
}

TEST(PlanSurvey, LightDarkensAllImages) {
  SimulateOptions options = CoarseTexels();
  options.light_ratio = 0.25;
  options.query_gain = 0;
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  EXPECT_EQ(survey.images[0].gain, 0.25);
  EXPECT_EQ(survey.queries[0].gain, 0.25);
}

TEST(PlanSurvey, SaysWhatLeavesNoPlace) {
  const Building building = *MakeBuilding(CoarseTexels(), 0);
  SimulateOptions wide = CoarseTexels();
  wide.spacing_m = 9;
  Result<Survey> survey = PlanSurvey(building, wide, 0);
  ASSERT_FALSE(survey.ok());
  EXPECT_EQ(survey.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(survey.error().message.find("spacing_m"), std::string::npos);
  for (const char* kind : {"lattice", "driven"}) {
    SimulateOptions shy = CoarseTexels();
    shy.clearance_m = 1.9;
    shy.survey = kind;
    survey = PlanSurvey(building, shy, 0);
    ASSERT_FALSE(survey.ok());
    EXPECT_EQ(survey.error().code, ErrorCode::kNoData);
    EXPECT_NE(survey.error().message.find("clearance"), std::string::npos);
  }
}

TEST(TakeImage, AddsWhatIsPlannedAndNothingElse) {
  SimulateOptions options = CoarseTexels();
  const Building building = *MakeBuilding(options, 0);
  const Survey survey = *PlanSurvey(building, options, 0);
  const Renderer renderer(building, survey.camera);
  PlannedImage image;
  image.cam_from_world = survey.images[10].cam_from_world;
  const cv::Mat clean = renderer.Render(image.cam_from_world);
  EXPECT_EQ(cv::norm(TakeImage(renderer, image, 1), clean, cv::NORM_INF), 0);

  image.noise = 3;
  const cv::Mat noisy = TakeImage(renderer, image, 1);
  EXPECT_NEAR(cv::norm(noisy, clean, cv::NORM_L2) / std::sqrt(640.0 * 480.0), 3, 0.1);
  EXPECT_NEAR(cv::mean(noisy)[0], cv::mean(clean)[0], 0.1);
  EXPECT_GT(cv::norm(noisy, TakeImage(renderer, image, 2), cv::NORM_INF), 0);

  image.noise = 0, image.gain = 0.8, image.bias = 10;
  EXPECT_NEAR(cv::mean(TakeImage(renderer, image, 1))[0], 0.8 * cv::mean(clean)[0] + 10, 0.1);

  // A turn about the vertical axis blurs across, symmetrically: the horizontal gradient falls,
  // brightness stays.
  image.gain = 1, image.bias = 0, image.turn = {0, 8.0 / 320, 0};
  const cv::Mat blurred = TakeImage(renderer, image, 1);
  const auto gradient_x = [](const cv::Mat& m) {
    return cv::norm(m.colRange(1, m.cols), m.colRange(0, m.cols - 1), cv::NORM_L1);
  };
  EXPECT_LT(gradient_x(blurred), 0.8 * gradient_x(clean));
  EXPECT_NEAR(cv::mean(blurred)[0], cv::mean(clean)[0], 2);
}

}  // namespace
}  // namespace cairn::sim
