#include "runtime/beams/beam_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

struct Room {
  std::vector<PlanWall> walls = OddRoom();
  PlanRays rays{walls};
  BeamModel model{walls, rays, {}};
};

// By hand: one wall 2 m ahead, of which the beam is 3 cm short.
TEST(BeamModel, OneBeamAtOneWall) {
  const std::vector<PlanWall> walls = {{{2, -1}, {2, 1}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {});
  const auto density = [](double off, double sigma) {
    return std::exp(-0.5 * off * off / (sigma * sigma)) / (sigma * std::sqrt(2 * std::numbers::pi));
  };
  // Thrown back by the wall, by something before it, or anywhere.
  const BeamEvidence met = model.Weigh({{{1, 0}, 1.97, true}}, {});
  EXPECT_NEAR(met.log_likelihood,
              std::log(0.9 * std::exp(-0.2) * density(0.03, 0.04) + 0.0005 + 0.1 * std::exp(-0.197)), 1e-9);
  EXPECT_EQ(met.sigma_m, 0.04);
  EXPECT_EQ(met.explained_ratio, 1);
  EXPECT_EQ(model.Weigh({{{1, 0}, 2.08, true}}, {}).sigma_m, 0.08);
  EXPECT_EQ(model.Weigh({{{1, 0}, 2.3, true}}, {}).sigma_m, 0.16);
  // Through it, to something behind.
  const BeamEvidence through = model.Weigh({{{1, 0}, 5, true}}, {});
  EXPECT_NEAR(through.log_likelihood, std::log(0.0005 + 0.1 * 0.1 * std::exp(-0.5)), 1e-9);
  EXPECT_EQ(through.explained_ratio, 0);
  // It met nothing, beside the wall and through it.
  EXPECT_NEAR(model.Weigh({{{0, 1}, 8, false}}, {}).log_likelihood, std::log(0.05 + std::exp(-0.8)), 1e-9);
  EXPECT_NEAR(model.Weigh({{{1, 0}, 8, false}}, {}).log_likelihood, std::log(0.05 + 0.1 * std::exp(-0.8)),
              1e-9);
  EXPECT_NEAR(model.WeighWithoutWalls({{{1, 0}, 5, true}, {{1, 0}, 8, false}}),
              std::log(0.0005 + 0.1 * std::exp(-0.5)) + std::log(0.05 + std::exp(-0.8)), 1e-9);
  // At a small angle a wall scatters ranges more: 30 degrees, twice as much.
  const double cosine = std::cos(RadFromDeg(60));
  const std::vector<PlanWall> slanted = {{{2, -10}, {2, 10}}};
  const PlanRays slanted_rays(slanted);
  EXPECT_NEAR(BeamModel(slanted, slanted_rays, {})
                  .Weigh({{{cosine, std::sin(RadFromDeg(60))}, 4.08, true}}, {})
                  .log_likelihood,
              std::log(0.9 * std::exp(-0.4) * density(0.08, 0.08) + 0.0005 + 0.1 * 0.1 * std::exp(-0.408)),
              1e-9);
}

TEST(BeamModel, TheSecondWallIsSeenThroughTheFirst) {
  const std::vector<PlanWall> walls = {{{2, -1}, {2, 1}}, {{4, -1}, {4, 1}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {});
  const double peak = 1 / (0.02 * std::sqrt(2 * std::numbers::pi));
  EXPECT_NEAR(model.Weigh({{{1, 0}, 4, true}}, {}).log_likelihood,
              std::log(0.1 * 0.9 * std::exp(-0.4) * peak + 0.0005 + 0.1 * 0.1 * std::exp(-0.4)), 1e-6);
}

// Of walls that are near to each other a beam met the nearer one, unless it ended at the other by half a
// sigma.
TEST(BeamModel, AWallInTheWayCounts) {
  const std::vector<PlanWall> walls = {{{2, -1}, {2, 1}}, {{2.08, -1}, {2.08, 1}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {});
  const auto refined_x = [&](double range) {
    std::vector<Beam> beams;
    for (int i = -5; i <= 5; ++i) {
      const Vec2 direction = Vec2(2, i / 10.0).normalized();
      beams.push_back({direction, range / direction.x(), true});
    }
    return model.Refine(beams, 0.1, {}).position.x();
  };
  EXPECT_NEAR(refined_x(2.076), 0.004, 1e-3);
  EXPECT_NEAR(refined_x(2.05), -0.05, 1e-3);
}

TEST(BeamModel, IsMostWhereTheScanWasTaken) {
  const Room room;
  Random random(1);
  const PlanarPose pose{{3, 2.5}, 0.3};
  const std::vector<Beam> beams = BeamsAt(room.walls, pose, 0.02, &random);
  const BeamEvidence there = room.model.Weigh(beams, pose);
  EXPECT_GT(there.explained_ratio, 0.95);
  EXPECT_EQ(there.sigma_m, 0.02);
  for (int i = 0; i < 50; ++i) {
    const double x = random.Uniform(0.2, 7), y = random.Uniform(0.2, 4.8);
    const PlanarPose other{{x, y}, random.Uniform(-3, 3)};
    if ((other.position - pose.position).norm() < 0.2) continue;
    EXPECT_LT(room.model.Weigh(beams, other).log_likelihood, there.log_likelihood - 50);
  }
}

TEST(BeamModel, RefinesAPoseAndSaysHowWellItIsKnown) {
  const Room room;
  double sum = 0, position = 0;
  constexpr int kNumScans = 200;
  for (int i = 0; i < kNumScans; ++i) {
    Random random(i);
    // Walls that each stand 3 cm and 0.2 degrees off, turned about their middles.
    std::vector<PlanWall> built = room.walls;
    for (PlanWall& wall : built) {
      const Vec2 along = (wall.end - wall.start).normalized(), normal(-along.y(), along.x());
      const double off = random.Normal(0, 0.03), turn = random.Normal(0, RadFromDeg(0.2)) * wall.Length() / 2;
      wall.start += (off - turn) * normal;
      wall.end += (off + turn) * normal;
    }
    const BeamModel model(room.walls, room.rays, {.sigma_wall_m = 0.03, .sigma_wall_deg = 0.2});
    const double x = random.Uniform(2.5, 3.5), y = random.Uniform(1, 4);
    const PlanarPose pose{{x, y}, random.Uniform(-3, 3)};
    const std::vector<Beam> beams = BeamsAt(built, pose, 0.02, &random);
    PlanarPose refined{pose.position + Vec2(random.Normal(0, 0.08), random.Normal(0, 0.08)),
                       pose.heading_rad + random.Normal(0, RadFromDeg(2))};
    for (const double sigma : {0.16, 0.06}) refined = model.Refine(beams, sigma, refined);
    const Eigen::Matrix3d covariance = model.Covariance(beams, 0.04, refined);
    Eigen::Vector3d error;
    error << refined.position - pose.position, WrapAngle(refined.heading_rad - pose.heading_rad);
    const double normalised = error.dot(covariance.inverse() * error);
    sum += std::min(normalised, 30.0);
    position += error.head<2>().squaredNorm();
  }
  // 3 degrees of freedom; the model's sigma of ranges is twice the true one.
  EXPECT_GT(sum / kNumScans, 1.5);
  EXPECT_LT(sum / kNumScans, 4.5);
  EXPECT_LT(std::sqrt(position / kNumScans), 0.05);
}

TEST(BeamModel, BeamsOnOneWallShareWhatItIsOff) {
  // One wall straight ahead: however many beams, its distance is known as well as the wall's place.
  const std::vector<PlanWall> walls = {{{2, -1}, {2, 1}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {.sigma_wall_m = 0.03, .sigma_wall_deg = 0.8});
  std::vector<Beam> beams;
  for (int i = -200; i <= 200; ++i) {
    const Vec2 direction = Vec2(2, i / 400.0).normalized();
    beams.push_back({direction, 2 / direction.x(), true});
  }
  const Eigen::Matrix3d covariance = model.Covariance(beams, 0.02, {});
  EXPECT_NEAR(std::sqrt(covariance(2, 2)), RadFromDeg(0.8), 0.003);
  const Eigen::Matrix3d information = covariance.inverse();
  EXPECT_NEAR(1 / std::sqrt(information(0, 0)), 0.03, 0.002);
  EXPECT_NEAR(covariance(1, 1), 100, 1);  // along it nothing is known
}

// At the end of a long wall its turn is about the part that is seen, not about its middle.
TEST(BeamModel, AtTheEndOfALongWallThePlaceIsKnownAsWell) {
  Eigen::Matrix3d covariances[2];
  for (const bool is_long : {false, true}) {
    const double length = is_long ? 120 : 8;
    const std::vector<PlanWall> walls = {{{0, 0}, {length, 0}}, {{0, 0}, {0, length}}};
    const PlanRays rays(walls);
    const BeamModel model(walls, rays, {.sigma_wall_m = 0.06, .sigma_wall_deg = 0.8});
    Random random(2);
    covariances[is_long] = model.Covariance(BeamsAt(walls, {{2, 2}, RadFromDeg(-135)}, 0.01, &random, 6),
                                            0.02, {{2, 2}, RadFromDeg(-135)});
  }
  EXPECT_LT(std::sqrt(covariances[1](0, 0)), 0.1);
  EXPECT_NEAR(std::sqrt(covariances[1](0, 0)), std::sqrt(covariances[0](0, 0)), 0.01);
  EXPECT_NEAR(std::sqrt(covariances[1](1, 1)), std::sqrt(covariances[0](1, 1)), 0.01);
}

}  // namespace
}  // namespace cairn
