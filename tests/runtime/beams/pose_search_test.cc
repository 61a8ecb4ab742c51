#include "runtime/beams/pose_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

double Turn(const PlanarPose& a, const PlanarPose& b) {
  return std::abs(WrapAngle(a.heading_rad - b.heading_rad));
}

TEST(EndsApart, KeepTheDirectionOfWalls) {
  // A wall along y 2 m ahead, seen over 40 degrees, and a point alone to the left.
  std::vector<Beam> beams;
  for (int degree = -20; degree <= 20; ++degree) {
    const Vec2 direction(std::cos(RadFromDeg(degree)), std::sin(RadFromDeg(degree)));
    beams.push_back({direction, 2 / direction.x(), true});
  }
  beams.push_back({{std::cos(RadFromDeg(60)), std::sin(RadFromDeg(60))}, 9, true});
  beams.push_back({{0, 1}, 20, false});
  const std::vector<BeamEnd> ends = EndsApart(beams, 0.15);
  ASSERT_GT(ends.size(), 6u);
  ASSERT_LT(ends.size(), 12u);
  for (size_t i = 0; i + 1 < ends.size(); ++i) {
    ASSERT_TRUE(ends[i].along_rad.has_value());
    EXPECT_NEAR(std::abs(std::remainder(*ends[i].along_rad - RadFromDeg(90), std::numbers::pi)), 0, 1e-6);
    for (size_t k = 0; k < i; ++k) EXPECT_GE((ends[i].place - ends[k].place).norm(), 0.15);
  }
  EXPECT_FALSE(ends.back().along_rad.has_value());
  EXPECT_NEAR(ends.back().place.norm(), 9, 1e-9);
}

TEST(EndsApart, KnowDirectionsOfDenseScansToo) {
  for (const double step_deg : {1.0, 0.25, 0.05}) {
    Random random(1);
    std::vector<Beam> beams;
    for (double degree = -30; degree <= 30; degree += step_deg) {
      const Vec2 direction(std::cos(RadFromDeg(degree)), std::sin(RadFromDeg(degree)));
      beams.push_back({direction, 1 / direction.x() + random.Normal(0, 0.01), true});
    }
    const std::vector<BeamEnd> ends = EndsApart(beams, 0.15);
    ASSERT_GE(ends.size(), 5u);
    int num_right = 0;
    for (const BeamEnd& end : ends) {
      num_right += end.along_rad && std::abs(std::remainder(*end.along_rad - RadFromDeg(90),
                                                            std::numbers::pi)) < RadFromDeg(15)
                       ? 1
                       : 0;
    }
    EXPECT_GE(num_right, std::ssize(ends) - 1) << step_deg;
  }
  // The same place each time has no direction.
  const std::vector<Beam> same(20, Beam{{1, 0}, 3, true});
  EXPECT_FALSE(EndsApart(same, 0.15).at(0).along_rad.has_value());
}

TEST(SearchPoses, FindsThePlaceOfAScan) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  Random random(2);
  double nearest = std::numeric_limits<double>::infinity();  // of two poses of one heading
  for (int i = 0; i < 12; ++i) {
    const double x = random.Uniform(2.5, 3.7), y = random.Uniform(0.5, 4.5);
    const PlanarPose pose{{x, y}, random.Uniform(-3, 3)};
    const auto ends = EndsApart(BeamsAt(walls, pose, 0.01, &random), 0.15);
    const PoseSearchResult result = SearchPoses(field, ends, {});
    ASSERT_TRUE(result.complete);
    ASSERT_FALSE(result.poses.empty());
    EXPECT_TRUE(std::any_of(result.poses.begin(), result.poses.end(), [&](const FieldPose& found) {
      return (found.pose.position - pose.position).norm() < 0.2 && Turn(found.pose, pose) < RadFromDeg(4);
    })) << i;
    for (size_t k = 0; k < result.poses.size(); ++k) {
      EXPECT_GE(result.poses[k].fit, 0.69 * result.poses[0].fit);
      EXPECT_LE(result.poses[k].fit, k == 0 ? 1 : result.poses[k - 1].fit);
      for (size_t other = 0; other < k; ++other) {
        const PlanarPose &a = result.poses[k].pose, &b = result.poses[other].pose;
        EXPECT_TRUE((a.position - b.position).norm() >= 0.35 || Turn(a, b) >= RadFromDeg(8));
        if (Turn(a, b) < RadFromDeg(8)) nearest = std::min(nearest, (a.position - b.position).norm());
      }
    }
  }
  EXPECT_LT(nearest, 0.45);
}

// Branch and bound leaves out no pose: the best is that of all cells and headings.
TEST(SearchPoses, FindsTheBestOfAll) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  const CellGrid& grid = field.grid();
  Random random(5);
  const PlanarPose pose{{5.2, 1.7}, 0.4};
  const auto ends = EndsApart(BeamsAt(walls, pose, 0.02, &random), 0.3);
  PoseSearchOptions options;
  options.step_deg = 10;
  const PoseSearchResult result = SearchPoses(field, ends, options);
  double best = 0;
  for (int heading = 0; heading < 36; ++heading) {
    const double turn = heading * RadFromDeg(10);
    for (int row = 0; row < grid.num_rows; ++row) {
      for (int column = 0; column < grid.num_columns; ++column) {
        int sum = 0;
        for (const BeamEnd& end : ends) {
          const Vec2 at = Eigen::Rotation2Dd(turn) * end.place / grid.cell_m;
          const int layer = end.along_rad ? WallField::LayerOf(*end.along_rad + turn) : WallField::kAllWalls;
          sum += field.Best(layer, 0, column + static_cast<int>(std::lround(at.x())),
                            row + static_cast<int>(std::lround(at.y())));
        }
        best = std::max(best, sum / (255.0 * static_cast<double>(ends.size())));
      }
    }
  }
  ASSERT_FALSE(result.poses.empty());
  EXPECT_NEAR(result.poses[0].fit, best, 1e-12);
  EXPECT_LT(result.num_windows, 36 * static_cast<int64_t>(grid.size()) / 10);
}

TEST(SearchPoses, EndsWhereItMust) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  EXPECT_TRUE(SearchPoses(field, {}, {}).poses.empty());
  // One point lies at a wall from anywhere: as many poses as are asked for.
  const std::vector<BeamEnd> one = {{{1, 0}, std::nullopt}};
  EXPECT_EQ(SearchPoses(field, one, {.max_num_poses = 7}).poses.size(), 7u);
  EXPECT_FALSE(SearchPoses(field, one, {.max_num_poses = 7}).complete);
  Random random(1);
  const auto ends = EndsApart(BeamsAt(walls, {{3, 3}, 1}, 0.01, &random), 0.15);
  const PoseSearchResult cut = SearchPoses(field, ends, {.max_num_lookups = 100});
  EXPECT_FALSE(cut.complete);
  EXPECT_TRUE(cut.poses.empty());
}

// Ends in a row along y, `step_m` apart, and to and fro by `off_m` across it.
std::vector<Beam> Zigzag(int num, double step_m, double off_m) {
  std::vector<Beam> beams;
  for (int i = 0; i < num; ++i) {
    const Vec2 end(2 + (i % 2 == 0 ? off_m : -off_m), step_m * i);
    beams.push_back({end.normalized(), end.norm(), true});
  }
  return beams;
}

TEST(EndsApart, HaveADirectionWhereNeighboursAreNarrowEnough) {
  const auto has_direction = [](const std::vector<Beam>& beams, size_t i) {
    return EndsApart(beams, 0.001).at(i).along_rad.has_value();
  };
  // Of 13 ends within 0.3 m either way: 0.19 m along and 0.15 of that, 2.8 cm, across.
  EXPECT_TRUE(has_direction(Zigzag(21, 0.05, 0.024), 10));
  EXPECT_FALSE(has_direction(Zigzag(21, 0.05, 0.033), 10));
  // Three are enough, two are not; nor are those that are farther off or that follow one that met nothing.
  EXPECT_TRUE(has_direction(Zigzag(3, 0.1, 0), 1));
  EXPECT_TRUE(has_direction(Zigzag(3, 0.1, 0), 0));
  EXPECT_FALSE(has_direction(Zigzag(2, 0.1, 0), 0));
  EXPECT_TRUE(has_direction(Zigzag(3, 0.29, 0), 1));
  EXPECT_FALSE(has_direction(Zigzag(3, 0.31, 0), 1));
  std::vector<Beam> interrupted = Zigzag(4, 0.1, 0);
  interrupted[2].met = false;
  EXPECT_FALSE(has_direction(interrupted, 1));
  // Nearer than 2.5 cm to each other they are one.
  EXPECT_FALSE(has_direction(Zigzag(4, 0.012, 0), 0));
  EXPECT_FALSE(has_direction(Zigzag(4, 0.013, 0), 0));
  EXPECT_TRUE(has_direction(Zigzag(5, 0.013, 0), 0));
}

TEST(SearchPoses, HeadingsBeginAtNone) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  Random random(3);
  const PlanarPose pose{field.grid().Middle(50, 45), 0};
  const auto ends = EndsApart(BeamsAt(walls, pose, 0, &random), 0.15);
  EXPECT_EQ(SearchPoses(field, ends, {.step_deg = 15}).poses.at(0).pose.heading_rad, 0);
}

// In a corner, whichever of its walls is the first.
TEST(RefineByEnds, BringsEndsToTheirWalls) {
  const PlanWall lower = {{0, 0}, {6, 0}}, left = {{0, 6}, {0, 0}};
  const PlanarPose pose{{2, 1.5}, -2.2};
  for (const auto& walls : {std::vector{lower, left}, std::vector{left, lower}}) {
    const WallField field(walls);
    Random random(1);
    const auto ends = EndsApart(BeamsAt(walls, pose, 0, &random), 0.15);
    const PlanarPose near{pose.position + Vec2(0.08, -0.06), pose.heading_rad + 0.03};
    const PlanarPose refined = RefineByEnds(field, walls, ends, near);
    EXPECT_LT((refined.position - pose.position).norm(), 1e-3);
    EXPECT_LT(Turn(refined, pose), 1e-3);
  }
}

}  // namespace
}  // namespace cairn
