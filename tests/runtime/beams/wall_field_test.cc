#include "runtime/beams/wall_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/geometry/planar_pose.h"
#include "tests/runtime/beams/laser_fixture.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

double DistanceTo(const PlanWall& wall, const Vec2& place) {
  const Vec2 along = wall.end - wall.start;
  const double share = std::clamp(along.dot(place - wall.start) / along.squaredNorm(), 0.0, 1.0);
  return (place - wall.start - share * along).norm();
}

TEST(WallField, IsHighAtWallsAndKnowsTheNearest) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  const CellGrid& grid = field.grid();
  EXPECT_DOUBLE_EQ(grid.cell_m, 0.1);
  EXPECT_NEAR(field.reach_m(), 0.396, 1e-9);
  int num_near = 0;
  for (int row = 0; row < grid.num_rows; ++row) {
    for (int column = 0; column < grid.num_columns; ++column) {
      const Vec2 middle = grid.Middle(column, row);
      double nearest = std::numeric_limits<double>::infinity();
      for (const PlanWall& wall : walls) nearest = std::min(nearest, DistanceTo(wall, middle));
      const int32_t found = field.NearestWall(middle);
      if (std::abs(nearest - field.reach_m()) < 1e-6) continue;
      ASSERT_EQ(found >= 0, nearest < field.reach_m()) << middle.transpose();
      if (found >= 0) {
        ++num_near;
        EXPECT_NEAR(DistanceTo(walls[found], middle), nearest, 1e-6);
      }
      const double value = nearest < field.reach_m() ? 255 * std::exp(-0.5 * std::pow(nearest / 0.12, 2)) : 0;
      EXPECT_NEAR(field.Best(WallField::kAllWalls, 0, column, row), value, 0.6);
    }
  }
  EXPECT_GT(num_near, 1000);
  EXPECT_EQ(field.NearestWall({-50, 0}), -1);
  EXPECT_EQ(field.NearestWall({0, 1e6}), -1);
}

TEST(WallField, AWindowHasTheBestOfItsCells) {
  const std::vector<PlanWall> walls = OddRoom();
  const WallField field(walls);
  const CellGrid& grid = field.grid();
  Random random(3);
  for (int i = 0; i < 400; ++i) {
    const int level = 1 + i % WallField::kTopLevel, layer = i % (WallField::kNumDirections + 1);
    const int size = 1 << level;
    const int column = static_cast<int>(random.Uniform(-size - 3, grid.num_columns + 3));
    const int row = static_cast<int>(random.Uniform(-size - 3, grid.num_rows + 3));
    int best = 0;
    for (int y = row; y < row + size; ++y) {
      for (int x = column; x < column + size; ++x) best = std::max(best, field.Best(layer, 0, x, y));
    }
    // A window that begins outside may count more than its own cells, never less.
    const int found = field.Best(layer, level, column, row);
    if (column >= 0 && row >= 0) {
      EXPECT_EQ(found, best) << level << " " << column << " " << row;
    } else {
      EXPECT_GE(found, best);
    }
  }
}

TEST(WallField, LayersHaveTheWallsOfTheirDirection) {
  // One along x, one along y, one at 20 degrees, which two layers have.
  const std::vector<PlanWall> walls = {
      {{0, 0}, {2, 0}}, {{5, 0}, {5, 2}}, {{8, 0}, {8 + std::cos(RadFromDeg(20)), std::sin(RadFromDeg(20))}}};
  const WallField field(walls);
  const auto has = [&](int layer, int wall) {
    const Eigen::Vector2i cell = field.grid().CellOf(0.5 * (walls[wall].start + walls[wall].end));
    return field.Best(layer, 0, cell.x(), cell.y()) > 150;
  };
  std::vector<std::vector<int>> layers_of(3);
  for (int wall = 0; wall < 3; ++wall) {
    for (int layer = 0; layer <= WallField::kNumDirections; ++layer) {
      if (has(layer, wall)) layers_of[wall].push_back(layer);
    }
  }
  EXPECT_THAT(layers_of[0], testing::ElementsAre(0, WallField::kAllWalls));
  EXPECT_THAT(layers_of[1], testing::ElementsAre(2, WallField::kAllWalls));
  EXPECT_THAT(layers_of[2], testing::ElementsAre(0, 1, WallField::kAllWalls));
  EXPECT_EQ(WallField::LayerOf(0), 0);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(22)), 0);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(23)), 1);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(90)), 2);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(-90)), 2);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(170)), 0);
  EXPECT_EQ(WallField::LayerOf(RadFromDeg(181)), 0);
}

TEST(CellGrid, LargePlansHaveLargerCells) {
  const std::vector<PlanWall> hall = {{{0, 0}, {3000, 0}}, {{3000, 0}, {3000, 2000}}};
  const CellGrid grid = GridAround(hall, 1, 0.1, 1 << 20);
  EXPECT_LE(grid.size(), (1u << 20) + grid.num_columns + grid.num_rows);
  EXPECT_GT(grid.size(), (1u << 20) * 0.98);
  const std::vector<PlanWall> line = {{{0, 0}, {1e9, 0}}};
  EXPECT_LE(GridAround(line, 1, 0.1, 1000).num_columns, 1001);
  EXPECT_EQ(GridAround({}, 1, 0.5, 100).size(), 25u);
}

// Layers are 45 degrees apart, and each has walls up to 37 degrees off: 14.5 more than half of that.
TEST(WallField, ALayerHasWallsOfSoMuchOtherDirections) {
  for (const auto& [degree, is_in] :
       {std::pair(36.9, true), {37.1, false}, {-36.9, true}, {-37.1, false}, {143.1, true}, {142.9, false}}) {
    const Vec2 along(std::cos(RadFromDeg(degree)), std::sin(RadFromDeg(degree)));
    const std::vector<PlanWall> walls = {{-along, along}};
    const WallField field(walls);
    const Eigen::Vector2i cell = field.grid().CellOf({0, 0});
    EXPECT_EQ(field.Best(0, 0, cell.x(), cell.y()) > 0, is_in) << degree;
    EXPECT_GT(field.Best(WallField::kAllWalls, 0, cell.x(), cell.y()), 150);
  }
}

// On the bisector of a corner both walls are equally near, whatever their directions.
TEST(WallField, OfWallsThatAreEquallyNearTheFirstIsTheNearest) {
  const std::vector<PlanWall> upright_first = {{{0, 0}, {0, 2}}, {{0, 0}, {2, 0}}};
  const std::vector<PlanWall> level_first = {{{0, 0}, {2, 0}}, {{0, 0}, {0, 2}}};
  for (const auto& walls : {upright_first, level_first}) {
    const WallField field(walls);
    const CellGrid& grid = field.grid();
    ASSERT_EQ(grid.low.x(), grid.low.y());
    int num_near = 0;
    for (int k = 0; k < grid.num_rows; ++k) {
      const Vec2 middle = grid.Middle(k, k);
      if (middle.x() <= 0 || middle.x() > 0.35) continue;
      EXPECT_EQ(field.NearestWall(middle), 0) << middle.x();
      ++num_near;
    }
    EXPECT_GE(num_near, 3);
  }
}

}  // namespace
}  // namespace cairn
