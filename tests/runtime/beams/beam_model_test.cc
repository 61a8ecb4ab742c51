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

// Ranges to a wall that is seen at 5 degrees scatter by 1 / 0.15 of sigma, and by half a metre at most.
TEST(BeamModel, RangesToAWallSeenAtALowAngleScatterSoFar) {
  const std::vector<PlanWall> walls = {{{2, -10}, {2, 40}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {});
  const Vec2 direction(std::cos(RadFromDeg(85)), std::sin(RadFromDeg(85)));
  const double distance = 2 / direction.x();
  const auto weighed = [&](double off) { return model.Weigh({{direction, distance + off, true}}, {}); };
  const auto expected = [&](double off, double sigma) {
    const double density =
        std::exp(-0.5 * off * off / (sigma * sigma)) / (sigma * std::sqrt(2 * std::numbers::pi));
    return std::log(0.9 * std::exp(-0.1 * distance) * density + 0.0005 +
                    0.1 * (off > 0 ? 0.1 : 1) * std::exp(-0.1 * (distance + off)));
  };
  EXPECT_NEAR(weighed(0.13).log_likelihood, expected(0.13, 0.02 / 0.15), 1e-9);
  EXPECT_EQ(weighed(0.13).sigma_m, 0.02);
  EXPECT_NEAR(weighed(0.9).log_likelihood, expected(0.9, 0.5), 1e-9);
  EXPECT_NEAR(weighed(-0.9).log_likelihood, expected(-0.9, 0.5), 1e-9);
  // A wall more than a metre behind the end of a beam is none.
  EXPECT_NEAR(weighed(-1.1).log_likelihood, std::log(0.0005 + 0.1 * std::exp(-0.1 * (distance - 1.1))), 1e-9);
}

TEST(BeamModel, OfTheBeamsThatMetSomethingAShareIsExplained) {
  const std::vector<PlanWall> walls = {{{2, -1}, {2, 1}}};
  const PlanRays rays(walls);
  const BeamModel model(walls, rays, {});
  const Beam lost{{0, 1}, 8, false}, at_wall{{1, 0}, 2, true}, before_it{{1, 0}, 1, true};
  EXPECT_EQ(model.Weigh({lost, at_wall, lost}, {}).explained_ratio, 1);
  EXPECT_EQ(model.Weigh({before_it, at_wall, lost, before_it, before_it}, {}).explained_ratio, 0.25);
  EXPECT_EQ(model.Weigh({lost}, {}).explained_ratio, 0);
}

// Six steps of 0.2 m and 0.05 rad at most.
TEST(BeamModel, RefinesInShortSteps) {
  const std::vector<PlanWall> walls = {{{2, -3}, {2, 3}}};
  const PlanRays rays(walls);
  std::vector<Beam> beams = {{{0, 1}, 8, false}};  // a lost one says nothing
  for (int i = -5; i <= 5; ++i) {
    const Vec2 direction = Vec2(2, i / 10.0).normalized();
    beams.push_back({direction, 2 / direction.x(), true});
  }
  const BeamModel model(walls, rays, {});
  PlanarPose refined = model.Refine(beams, 1, {{1.9, 0}, 0});
  EXPECT_NEAR(refined.position.x(), 1.9 - 6 * 0.2, 1e-6);
  EXPECT_NEAR(refined.heading_rad, 0, 1e-6);
  // A wall as far as three sigma is another one's.
  EXPECT_NEAR(model.Refine(beams, 0.1, {{0.29, 0}, 0}).position.x(), 0, 1e-3);
  EXPECT_EQ(model.Refine(beams, 0.1, {{0.31, 0}, 0}).position.x(), 0.31);
  // A square around the robot, which is turned too far.
  const std::vector<PlanWall> square = {
      {{2, -2}, {2, 2}}, {{2, 2}, {-2, 2}}, {{-2, 2}, {-2, -2}}, {{-2, -2}, {2, -2}}};
  const PlanRays square_rays(square);
  std::vector<Beam> around;
  for (int degree = 0; degree < 360; ++degree) {
    const Vec2 direction(std::cos(RadFromDeg(degree + 0.5)), std::sin(RadFromDeg(degree + 0.5)));
    around.push_back({direction, NearestAlong(square, {0, 0}, direction), true});
  }
  refined = BeamModel(square, square_rays, {}).Refine(around, 0.5, {{0, 0}, 0.4});
  EXPECT_NEAR(refined.position.norm(), 0, 1e-6);
  EXPECT_NEAR(refined.heading_rad, 0.4 - 6 * 0.05, 1e-6);
}

// Through a wall that is too far from their ends beams find the one behind.
TEST(BeamModel, RefinesToAWallBehindAnother) {
  const std::vector<PlanWall> walls = {{{2, -3}, {2, 3}}, {{4, -3}, {4, 3}}};
  const PlanRays rays(walls);
  std::vector<Beam> beams;
  for (int i = -5; i <= 5; ++i) {
    const Vec2 direction = Vec2(2, i / 10.0).normalized();
    beams.push_back({direction, 3.95 / direction.x(), true});
  }
  EXPECT_NEAR(BeamModel(walls, rays, {}).Refine(beams, 0.1, {}).position.x(), 0.05, 1e-4);
}

// By the errors of all beams at once: independent ones, and those that beams on one wall share.
TEST(BeamModel, ACovarianceIsThatOfBeamsWhoseWallsErr) {
  const std::vector<PlanWall> walls = {{{3, -1}, {3, 5}}, {{3, 5}, {-4, 6.4}}};
  const PlanRays rays(walls);
  const double sigma = 0.05, sigma_wall_m = 0.04, sigma_wall_deg = 1.5;
  const BeamModel model(walls, rays, {.sigma_wall_m = sigma_wall_m, .sigma_wall_deg = sigma_wall_deg});
  const PlanarPose pose{{0.7, 1.2}, 0.3};
  std::vector<Beam> beams = {{{-1, 0}, 8, false}};
  std::vector<int> wall_of;
  std::vector<Eigen::Vector3d> rows;
  std::vector<double> weights, places;
  for (int i = 0; i < 24; ++i) {
    const double angle = -0.5 + 0.1 * i, off = 0.02 * (i % 4) - 0.03;
    const Vec2 direction(std::cos(angle), std::sin(angle)),
        on_floor = Eigen::Rotation2Dd(pose.heading_rad) * direction;
    const int wall =
        NearestAlong({walls[0]}, pose.position, on_floor) < NearestAlong({walls[1]}, pose.position, on_floor)
            ? 0
            : 1;
    const Vec2 along = (walls[wall].end - walls[wall].start).normalized(), normal(-along.y(), along.x());
    // So far beyond the wall, along its normal.
    const double range = NearestAlong(walls, pose.position, on_floor) + off / normal.dot(on_floor);
    ASSERT_TRUE(std::isfinite(range));
    beams.push_back({direction, range, true});
    const Vec2 arm = range * on_floor;
    wall_of.push_back(wall);
    rows.push_back({normal.x(), normal.y(), normal.y() * arm.x() - normal.x() * arm.y()});
    weights.push_back(std::pow(1 - std::pow(off / (3 * sigma), 2), 2));
    places.push_back(along.dot(pose.position + arm - walls[wall].start));
  }
  const auto num = static_cast<int>(rows.size());
  Eigen::MatrixXd jacobian(num, 3), precision = Eigen::MatrixXd::Zero(num, num);
  Eigen::MatrixXd errors = sigma * sigma * Eigen::MatrixXd::Identity(num, num);
  for (int wall = 0; wall < 2; ++wall) {
    double sum = 0, middle = 0;
    for (int i = 0; i < num; ++i) {
      sum += wall_of[i] == wall ? weights[i] : 0;
      middle += wall_of[i] == wall ? weights[i] * places[i] : 0;
    }
    ASSERT_GT(sum, 3);
    middle /= sum;
    for (int i = 0; i < num; ++i) {
      for (int k = 0; k < num; ++k) {
        if (wall_of[i] == wall && wall_of[k] == wall)
          errors(i, k) += std::pow(sigma_wall_m, 2) + std::pow(RadFromDeg(sigma_wall_deg), 2) *
                                                          (places[i] - middle) * (places[k] - middle);
      }
    }
  }
  for (int i = 0; i < num; ++i) {
    jacobian.row(i) = rows[i].transpose();
    precision(i, i) = weights[i] / (sigma * sigma);
  }
  const Eigen::Matrix3d prior = Eigen::Vector3d(0.01, 0.01, 0.1).asDiagonal();
  const Eigen::Matrix3d inverse = (prior + jacobian.transpose() * precision * jacobian).inverse();
  const Eigen::Matrix3d gradient = prior + jacobian.transpose() * precision * errors * precision * jacobian;
  EXPECT_TRUE(model.Covariance(beams, sigma, pose).isApprox(inverse * gradient * inverse, 1e-9));
}

// Where nothing is met, as much is known as always.
TEST(BeamModel, WithoutBeamsThePlaceIsKnownToTenMetres) {
  const Room room;
  EXPECT_TRUE(room.model.Covariance({}, 0.05, {})
                  .isApprox(Eigen::Vector3d(100, 100, 10).asDiagonal().toDenseMatrix(), 1e-9));
}

}  // namespace
}  // namespace cairn
