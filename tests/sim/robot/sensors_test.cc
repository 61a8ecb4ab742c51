#include "sim/robot/sensors.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/geometry/pose.h"
#include "sim/render/building.h"
#include "sim/render/renderer.h"

namespace cairn::sim {
namespace {

constexpr SensorOptions kIdeal{
    .light_ratio = 1, .image_gain = 0, .image_noise = 0, .exposure_s = 0, .slip_ratio = 0};

TEST(SlippedMotion, IdealWheelsMoveAsCommanded) {
  const PlanarMotion motion = SlippedMotion({0.4, -0.7}, kIdeal, 3);
  EXPECT_NEAR(motion.speed_m_s, 0.4, 1e-12);
  EXPECT_NEAR(motion.turn_rad_s, -0.7, 1e-12);
}

TEST(SlippedMotion, ARobotThatStandsStaysThere) {
  const PlanarMotion motion = SlippedMotion({0, 0}, SensorOptions{.slip_ratio = 0.5}, 3);
  EXPECT_EQ(motion.speed_m_s, 0);
  EXPECT_EQ(motion.turn_rad_s, 0);
}

// Each wheel goes v (1 + s n) with n normal: of two wheels 0.3 m apart the speed's deviation is v s /
// sqrt(2), the turn's v s sqrt(2) / 0.3.
TEST(SlippedMotion, EachWheelSlipsByItself) {
  const SensorOptions options{.slip_ratio = 0.1, .wheel_base_m = 0.3};
  constexpr int kNum = 20000;
  double mean = 0, speed_squares = 0, turn_squares = 0;
  for (int i = 0; i < kNum; ++i) {
    const PlanarMotion motion = SlippedMotion({0.5, 0}, options, i);
    mean += motion.speed_m_s / kNum;
    speed_squares += std::pow(motion.speed_m_s - 0.5, 2) / kNum;
    turn_squares += std::pow(motion.turn_rad_s, 2) / kNum;
  }
  EXPECT_NEAR(mean, 0.5, 0.001);
  EXPECT_NEAR(std::sqrt(speed_squares), 0.5 * 0.1 / std::sqrt(2), 0.001);
  EXPECT_NEAR(std::sqrt(turn_squares), 0.5 * 0.1 * std::sqrt(2) / 0.3, 0.005);
}

TEST(SlippedMotion, IsTheSameForTheSameSeed) {
  EXPECT_EQ(SlippedMotion({0.5, 0.1}, {}, 7).turn_rad_s, SlippedMotion({0.5, 0.1}, {}, 7).turn_rad_s);
  EXPECT_NE(SlippedMotion({0.5, 0.1}, {}, 7).turn_rad_s, SlippedMotion({0.5, 0.1}, {}, 8).turn_rad_s);
}

TEST(ExposeImage, GainsLieAroundTheLight) {
  SensorOptions options = kIdeal;
  options.light_ratio = 0.5;
  options.image_gain = 0.2;
  double least = 1, most = 0, mean = 0;
  for (int i = 0; i < 1000; ++i) {
    const double gain = ExposeImage({}, {}, 1, options, i).gain;
    least = std::min(least, gain), most = std::max(most, gain), mean += gain / 1000;
  }
  EXPECT_GE(least, 0.4);
  EXPECT_LT(least, 0.41);
  EXPECT_LE(most, 0.6);
  EXPECT_GT(most, 0.59);
  EXPECT_NEAR(mean, 0.5, 0.01);
}

// The image of a robot that drives a curve to the left: the mean of what it sees on its way, not of what it
// would see on a curve to the right.
TEST(ExposeImage, BlursByTheWayThatTheRobotGoesMeanwhile) {
  SimulateOptions building_options;
  building_options.texel_m = 0.03;
  building_options.image_width_px = 160;
  building_options.image_height_px = 120;
  const Building building = *MakeBuilding(building_options, 0);
  const Renderer renderer(building, MakeQueryCamera(building_options));
  const Survey survey = *PlanSurvey(building, building_options, 0);
  const Eigen::Vector2d place = survey.stations[survey.stations.size() / 2];
  SensorOptions options = kIdeal;
  options.exposure_s = 0.1;
  const PlanarMotion motion{1.5, 0.6};
  const cv::Mat blurred = TakeImage(renderer, ExposeImage({place, 0.3}, motion, 1, options, 0), 0);
  // The mean over the same exposure with this turn: the robot's, or its mirror's.
  const auto mean_along = [&](double speed_m_s, double turn_rad_s) {
    constexpr int kNum = 64;
    cv::Mat sum = cv::Mat::zeros(120, 160, CV_32F);
    for (int i = 0; i < kNum; ++i) {
      const double time_s = options.exposure_s * ((i + 0.5) / kNum - 0.5);
      const Eigen::Vector2d at = place + time_s * speed_m_s * Eigen::Vector2d(std::cos(0.3), std::sin(0.3));
      sum += renderer.RenderFloat(MakePose({at.x(), at.y(), 1}, 0.3 + time_s * turn_rad_s)) / kNum;
    }
    return sum;
  };
  cv::Mat grey;
  blurred.convertTo(grey, CV_32F);
  const auto difference = [&](const cv::Mat& other) {
    return cv::norm(grey, other, cv::NORM_L2) / std::sqrt(160 * 120);
  };
  const double right = difference(mean_along(motion.speed_m_s, motion.turn_rad_s));
  EXPECT_LT(right, 1);  // grey values: rounding, and few renderings
  EXPECT_GT(difference(mean_along(motion.speed_m_s, -motion.turn_rad_s)), 2 * right);
  EXPECT_GT(difference(mean_along(-motion.speed_m_s, motion.turn_rad_s)), 2 * right);
  EXPECT_GT(difference(mean_along(0, 0)), 2 * right);
}

}  // namespace
}  // namespace cairn::sim
