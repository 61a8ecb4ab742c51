#include "runtime/drive/planar_epipoles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/geometry/pose.h"
#include "tests/option_limits.h"
#include "tests/runtime/drive/servo_scene.h"

namespace cairn {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ServoScene EpipolesRoom() {
  ServoScene scene;
  scene.points = RoomPoints({-5, -3}, {5, 3}, 700, 1);
  return scene;
}

std::vector<RayPair> Rays(const ServoScene& scene, const PlanarPose& current, const PlanarPose& target,
                          double focal_px, uint64_t seed = 1) {
  Random random(seed);
  std::vector<RayPair> rays;
  const Eigen::Vector2d middle(320, 240);
  for (const PixelPair& pair : scene.Match(current, target, &random)) {
    rays.push_back({(pair.current_px - middle) / focal_px, (pair.target_px - middle) / focal_px});
  }
  return rays;
}

struct Truth {
  double psi_rad, phi_rad, turn_rad;
};
Truth TruthOf(const PlanarPose& current, const PlanarPose& target) {
  const Eigen::Vector2d to_target = current.RobotFromFloor(target.position);
  const Eigen::Vector2d to_current = target.RobotFromFloor(current.position);
  return {std::atan2(to_target.y(), to_target.x()), std::atan2(to_current.y(), to_current.x()),
          WrapAngle(current.heading_rad - target.heading_rad)};
}

// All sides, ahead and behind, with and without turn.
std::vector<PlanarPose> Places() {
  std::vector<PlanarPose> places;
  for (const double x : {-2.0, -0.7, 0.0, 0.9}) {
    for (const double y : {-0.8, 0.0, 0.5}) {
      if (x == 0 && y == 0) continue;
      for (const double degrees : {-25.0, 0.0, 14.0}) places.push_back({{x, y}, RadFromDeg(degrees)});
    }
  }
  return places;
}

TEST(PlanarEpipoles, AreExactForExactMatches) {
  const ServoScene scene = EpipolesRoom();
  const PlanarPose target;
  for (const PlanarPose& place : Places()) {
    const Truth truth = TruthOf(place, target);
    const auto found = EstimatePlanarEpipoles(Rays(scene, place, target, 320), 320, {}, nullptr);
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_NEAR(WrapAngle(found->psi_rad - truth.psi_rad), 0, 1e-4) << place.position.transpose();
    EXPECT_NEAR(WrapAngle(found->phi_rad - truth.phi_rad), 0, 1e-4) << place.position.transpose();
    EXPECT_NEAR(WrapAngle(found->turn_rad - truth.turn_rad), 0, 1e-4) << place.position.transpose();
    EXPECT_NEAR(found->focal_ratio, 1, 1e-3);
  }
}

TEST(PlanarEpipoles, DoNotDependOnTheFrameOfTheFloor) {
  const ServoScene scene = EpipolesRoom();
  const PlanarPose target{{1, -0.5}, RadFromDeg(130)}, current{{1.6, -1.1}, RadFromDeg(112)};
  const Truth truth = TruthOf(current, target);
  const auto found = EstimatePlanarEpipoles(Rays(scene, current, target, 320), 320, {}, nullptr);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->psi_rad, truth.psi_rad, 1e-4);
  EXPECT_NEAR(found->phi_rad, truth.phi_rad, 1e-4);
}

TEST(PlanarEpipoles, SurviveNoiseAndFalseMatches) {
  ServoScene scene = EpipolesRoom();
  scene.noise_px = 0.5;
  scene.outlier_ratio = 0.3;
  const PlanarPose target;
  int num_good = 0;
  for (const PlanarPose& place : Places()) {
    const Truth truth = TruthOf(place, target);
    const auto found = EstimatePlanarEpipoles(Rays(scene, place, target, 320), 320, {}, nullptr);
    ASSERT_TRUE(found.ok()) << found.error().message;
    const double turn_deg = DegFromRad(std::abs(WrapAngle(found->turn_rad - truth.turn_rad)));
    const double phi_deg = DegFromRad(std::abs(WrapAngle(found->phi_rad - truth.phi_rad)));
    EXPECT_LT(turn_deg, 4) << place.position.transpose();
    num_good += phi_deg < 8;
  }
  EXPECT_EQ(num_good, Places().size());
}

TEST(PlanarEpipoles, LearnAWrongFocalLengthFromTheMatches) {
  const ServoScene scene = EpipolesRoom();
  const PlanarPose target, current{{-1.5, 0.6}, RadFromDeg(-20)};
  for (const double factor : {0.8, 1.2}) {
    const auto found =
        EstimatePlanarEpipoles(Rays(scene, current, target, 320 * factor), 320 * factor, {}, nullptr);
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_NEAR(found->focal_ratio, factor, 0.02);
    EXPECT_NEAR(found->turn_rad, RadFromDeg(-20), 0.02);
  }
}

// The end of a corridor: a wall straight ahead and some floor before it.
TEST(PlanarEpipoles, AWallAndItsFloorAreEnough) {
  ServoScene scene;
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const double y = random.Uniform(-4, 4), z = random.Uniform(-1, 1.6), x = random.Uniform(1.5, 3.5);
    scene.points.push_back(i % 4 == 0 ? Eigen::Vector3d(x, y, -1) : Eigen::Vector3d(3.5, y, z));
  }
  const PlanarPose target, current{{-1, 0.4}, RadFromDeg(-15)};
  const Truth truth = TruthOf(current, target);
  const auto found = EstimatePlanarEpipoles(Rays(scene, current, target, 320), 320, {}, nullptr);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->turn_rad, truth.turn_rad, 1e-3);
  EXPECT_NEAR(found->phi_rad, truth.phi_rad, 1e-3);
  EXPECT_NEAR(found->distance_ratio, 1.08 / 4, 0.08);  // the points are about 4 m away
}

TEST(PlanarEpipoles, WithoutBaselineTheTurnIsKnownAndTheDistanceIsNone) {
  ServoScene scene = EpipolesRoom();
  scene.noise_px = 0.5;
  const PlanarPose target, current{{0, 0}, RadFromDeg(17)};
  const auto found = EstimatePlanarEpipoles(Rays(scene, current, target, 320), 320, {}, nullptr);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found->turn_rad, RadFromDeg(17), RadFromDeg(1));
  EXPECT_LT(found->distance_ratio, 0.01);
}

TEST(PlanarEpipoles, TheDistanceIsInUnitsOfTheScenes) {
  const ServoScene scene = EpipolesRoom();
  const PlanarPose target, near{{-0.5, 0}, 0}, far{{-1, 0}, 0};
  const auto one = EstimatePlanarEpipoles(Rays(scene, near, target, 320), 320, {}, nullptr);
  const auto two = EstimatePlanarEpipoles(Rays(scene, far, target, 320), 320, {}, nullptr);
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_NEAR(two->distance_ratio / one->distance_ratio, 2, 0.1);
  EXPECT_NEAR(one->distance_ratio, 0.5 / 4.7, 0.03);
}

TEST(PlanarEpipoles, RefusesWhatTellsNothing) {
  const auto code = [](const std::vector<RayPair>& pairs) {
    const auto found = EstimatePlanarEpipoles(pairs, 320, {}, nullptr);
    return found.ok() ? std::string("ok") : std::string(ErrorCodeName(found.error().code));
  };
  EXPECT_EQ(code({}), "no_data");
  EXPECT_EQ(code(std::vector<RayPair>(5, {{0.1, 0.2}, {0.3, 0.1}})), "no_data");
  EXPECT_EQ(code(std::vector<RayPair>(100, {{0.1, 0.2}, {0.3, 0.1}})), "no_data");
  EXPECT_EQ(code(std::vector<RayPair>(100, {{0, 0}, {0, 0}})), "no_data");
  EXPECT_EQ(code(std::vector<RayPair>(100, {{kNan, 0}, {0, kNan}})), "no_data");
  EXPECT_EQ(code(std::vector<RayPair>(100, {{1e300, -1e300}, {1e300, 1e300}})), "no_data");
  Random random(4);
  std::vector<RayPair> chance;
  for (int i = 0; i < 200; ++i) {
    const auto draw = [&] {
      const double x = random.Uniform(-1, 1), y = random.Uniform(-0.75, 0.75);
      return Eigen::Vector2d(x, y);
    };
    const Eigen::Vector2d current = draw();
    chance.push_back({current, draw()});
  }
  EXPECT_EQ(code(chance), "no_data");
}

TEST(PlanarEpipoles, RefusesBadOptionsAndCameras) {
  PlanarEpipolesOptions options;
  options.noise_px = 0;
  EXPECT_EQ(EstimatePlanarEpipoles({}, 320, options, nullptr).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(EstimatePlanarEpipoles({}, kNan, {}, nullptr).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(EstimatePlanarEpipoles({}, -1, {}, nullptr).error().code, ErrorCode::kInvalidArgument);
}

TEST(PlanarEpipoles, MarksMatchesThatAreNotFiniteAsOutliers) {
  const ServoScene scene = EpipolesRoom();
  const PlanarPose target, current{{-1, 0.3}, 0.1};
  std::vector<RayPair> rays = Rays(scene, current, target, 320);
  rays.insert(rays.begin(), {{kNan, 0}, {0, 0}});
  const auto found = EstimatePlanarEpipoles(rays, 320, {}, nullptr);
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(found->is_inlier[0], 0);
  EXPECT_EQ(found->is_inlier[1], 1);
  EXPECT_EQ(found->num_inliers, static_cast<int>(rays.size()) - 1);
}

TEST(PlanarEpipoles, OptionsHaveTheirRanges) {
  ExpectLimits<PlanarEpipolesOptions>({{"noise_px", "0.01", "0.009", "10", "10.001"},
                                       {"focal_ratio", "0.2", "0.199", "5", "5.001"},
                                       {"focal_error_ratio", "0.001", "0.0009", "0.5", "0.501"},
                                       {"min_num_inliers", "4", "3"},
                                       {"min_inlier_ratio", "0", "-0.001", "1", "1.001"},
                                       {"min_spread_px", "0", "-0.001", "10000", "10000.1"},
                                       {"num_samples", "1", "0", "100000", "100001"}});
}

}  // namespace
}  // namespace cairn
