#include "stages/decompose_views/formats/grid_walls.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "stages/decompose_views/formats/thin_lines.h"

namespace cairn::decompose_views {
namespace {

using testing::HasSubstr;
using Vec2 = Eigen::Vector2d;

constexpr double kCellM = 0.05;

// All free.
OccupancyGrid EmptyGrid(int columns, int rows) {
  return {cv::Mat(rows, columns, CV_8U, cv::Scalar(static_cast<int>(CellState::kFree))), kCellM, {}};
}

// Columns and rows, the last ones included.
void Fill(OccupancyGrid* grid, int column, int row, int last_column, int last_row,
          CellState state = CellState::kOccupied) {
  grid->cells(cv::Range(row, last_row + 1), cv::Range(column, last_column + 1))
      .setTo(static_cast<int>(state));
}

void Outline(OccupancyGrid* grid, int column, int row, int last_column, int last_row) {
  Fill(grid, column, row, last_column, row);
  Fill(grid, column, last_row, last_column, last_row);
  Fill(grid, column, row, column, last_row);
  Fill(grid, last_column, row, last_column, last_row);
}

std::vector<InputSegment> Walls(const OccupancyGrid& grid, const GridWallsOptions& options = {}) {
  const auto walls = TraceGridWalls(grid, options);
  EXPECT_TRUE(walls.ok()) << walls.error().message;
  return walls.ok() ? *walls : std::vector<InputSegment>();
}

// Whether there is a wall between two places, in cells, either way round.
bool HasWall(const std::vector<InputSegment>& walls, const Vec2& a, const Vec2& b,
             double within_cells = 1e-6) {
  return std::any_of(walls.begin(), walls.end(), [&](const InputSegment& wall) {
    const Vec2 start = wall.start / kCellM, end = wall.end / kCellM;
    return std::min(std::max((start - a).norm(), (end - b).norm()),
                    std::max((start - b).norm(), (end - a).norm())) <= within_cells;
  });
}

double DistanceTo(const std::vector<InputSegment>& walls, const Vec2& place) {
  double nearest = 1e9;
  for (const InputSegment& wall : walls) {
    const Vec2 along = wall.end - wall.start;
    const double share = std::clamp((place - wall.start).dot(along) / along.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (place - wall.start - share * along).norm());
  }
  return nearest;
}

TEST(GridWalls, AWallOfOneCellIsALineThroughItsMiddle) {
  OccupancyGrid grid = EmptyGrid(60, 40);
  Outline(&grid, 5, 4, 54, 33);
  const auto walls = Walls(grid);
  EXPECT_EQ(walls.size(), 4u);
  EXPECT_TRUE(HasWall(walls, {5.5, 4.5}, {54.5, 4.5}));
  EXPECT_TRUE(HasWall(walls, {54.5, 4.5}, {54.5, 33.5}));
  EXPECT_TRUE(HasWall(walls, {54.5, 33.5}, {5.5, 33.5}));
  EXPECT_TRUE(HasWall(walls, {5.5, 33.5}, {5.5, 4.5}));
}

TEST(GridWalls, AWallOfTwoCellsIsALineBetweenThem) {
  OccupancyGrid grid = EmptyGrid(60, 40);
  Fill(&grid, 5, 10, 54, 11);
  Fill(&grid, 20, 20, 21, 38);
  const auto walls = Walls(grid);
  ASSERT_EQ(walls.size(), 2u);
  EXPECT_TRUE(HasWall(walls, {5.5, 11}, {54.5, 11}, 1.5));
  for (const InputSegment& wall : walls) {
    const bool is_level = std::abs(wall.start.y() - wall.end.y()) < 0.1;
    const Vec2 middle = 0.5 * (wall.start + wall.end) / kCellM;
    EXPECT_NEAR(is_level ? middle.y() : middle.x(), is_level ? 11 : 21, 1e-6);
  }
}

//   ##################
//   #       #        #     the wall inside begins on the one below, and ends freely
//   #       #        #
//   ##################
TEST(GridWalls, AWallThatBranchesOffBeginsOnTheOther) {
  OccupancyGrid grid = EmptyGrid(60, 40);
  Outline(&grid, 5, 4, 54, 33);
  Fill(&grid, 25, 4, 25, 20);
  const auto walls = Walls(grid);
  EXPECT_EQ(walls.size(), 5u);
  EXPECT_TRUE(HasWall(walls, {5.5, 4.5}, {54.5, 4.5}, 0.1));
  EXPECT_TRUE(HasWall(walls, {25.5, 4.5}, {25.5, 20.5}, 0.1));
  const auto branch = std::find_if(walls.begin(), walls.end(), [](const InputSegment& wall) {
    return std::abs(wall.start.x() / kCellM - 25.5) < 0.5 && std::abs(wall.end.x() / kCellM - 25.5) < 0.5;
  });
  ASSERT_NE(branch, walls.end());
  std::vector<InputSegment> others = walls;
  others.erase(others.begin() + (branch - walls.begin()));
  EXPECT_LT(std::min(DistanceTo(others, branch->start), DistanceTo(others, branch->end)), 1e-9);
}

TEST(GridWalls, AThickWallHasItsFacesWhereTheCellsEnd) {
  OccupancyGrid grid = EmptyGrid(80, 60);
  Fill(&grid, 10, 20, 69, 29);
  const auto walls = Walls(grid);
  EXPECT_EQ(walls.size(), 4u);
  EXPECT_TRUE(HasWall(walls, {10, 20}, {70, 20}, 0.2));
  EXPECT_TRUE(HasWall(walls, {70, 20}, {70, 30}, 0.2));
  EXPECT_TRUE(HasWall(walls, {70, 30}, {10, 30}, 0.2));
  EXPECT_TRUE(HasWall(walls, {10, 30}, {10, 20}, 0.2));
  // As one line in its middle, where it counts as thin.
  const auto line = Walls(grid, {.thin_wall_m = 0.6});
  ASSERT_EQ(line.size(), 1u);
  EXPECT_NEAR(line[0].start.y() / kCellM, 25, 0.01);
  EXPECT_NEAR(line[0].end.y() / kCellM, 25, 0.01);
}

TEST(GridWalls, OnlyTheSideThatBeamsReachIsAWall) {
  OccupancyGrid grid = EmptyGrid(80, 60);
  Fill(&grid, 0, 20, 79, 29);
  Fill(&grid, 0, 30, 79, 59, CellState::kUnknown);
  const auto walls = Walls(grid);
  ASSERT_EQ(walls.size(), 1u);
  EXPECT_NEAR(walls[0].start.y() / kCellM, 20, 1e-6);
  EXPECT_NEAR(walls[0].end.y() / kCellM, 20, 1e-6);
  // Without a free cell there is none.
  grid.cells.setTo(static_cast<int>(CellState::kUnknown), grid.cells == static_cast<int>(CellState::kFree));
  const auto none = TraceGridWalls(grid, {});
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
  EXPECT_THAT(none.error().message, HasSubstr("800 cells are occupied, 0 free, 4000 unknown"));
}

TEST(GridWalls, UnknownCellsAreNoWalls) {
  OccupancyGrid grid = EmptyGrid(80, 60);
  Fill(&grid, 0, 30, 79, 59, CellState::kUnknown);
  const auto none = TraceGridWalls(grid, {});
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNoData);
}

TEST(GridWalls, SpecklesAndHolesAreLeftOut) {
  OccupancyGrid clean = EmptyGrid(80, 60);
  Outline(&clean, 5, 4, 74, 53);
  Fill(&clean, 40, 20, 50, 30);
  OccupancyGrid noisy = clean;
  noisy.cells = clean.cells.clone();
  for (int i = 0; i < 8; ++i) Fill(&noisy, 10 + 3 * i, 10 + 4 * i, 10 + 3 * i, 11 + 4 * i);
  Fill(&noisy, 44, 24, 46, 26, CellState::kUnknown);
  const auto expected = Walls(clean), found = Walls(noisy);
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].start, expected[i].start);
    EXPECT_EQ(found[i].end, expected[i].end);
  }
  EXPECT_GT(Walls(noisy, {.min_blob_m = 0}).size(), expected.size());
}

TEST(GridWalls, AnObliqueWallIsOneLine) {
  for (const double deg : {7.0, 30.0, 45.0, 68.0, 101.0, 163.0}) {
    OccupancyGrid grid = EmptyGrid(400, 400);
    const Vec2 along(std::cos(RadFromDeg(deg)), std::sin(RadFromDeg(deg)));
    const Vec2 start = Vec2(200, 200) - 150 * along, end = Vec2(200, 200) + 150 * along;
    const auto cell = [](const Vec2& place) {
      return cv::Point(static_cast<int>(std::floor(place.x())), static_cast<int>(std::floor(place.y())));
    };
    cv::line(grid.cells, cell(start), cell(end), cv::Scalar(static_cast<int>(CellState::kOccupied)));
    const auto walls = Walls(grid);
    ASSERT_EQ(walls.size(), 1u) << deg;
    EXPECT_TRUE(HasWall(walls, start, end, 1)) << deg;
    const Vec2 found = (walls[0].end - walls[0].start).normalized();
    EXPECT_LT(std::abs(found.x() * along.y() - found.y() * along.x()), std::sin(RadFromDeg(0.3))) << deg;
  }
}

TEST(GridWalls, TheMapsOriginAndYawPutThemIntoItsFrame) {
  OccupancyGrid grid = EmptyGrid(60, 40);
  Fill(&grid, 5, 10, 54, 10);
  grid.origin = {{3, -2}, std::numbers::pi / 2};
  const auto walls = Walls(grid);
  ASSERT_EQ(walls.size(), 1u);
  // (x, y) cells lie at origin + (-y, x).
  for (const Vec2& end : {walls[0].start, walls[0].end}) EXPECT_NEAR(end.x(), 3 - 10.5 * kCellM, 1e-9);
  EXPECT_NEAR(std::min(walls[0].start.y(), walls[0].end.y()), -2 + 5.5 * kCellM, 1e-9);
  EXPECT_NEAR(std::max(walls[0].start.y(), walls[0].end.y()), -2 + 54.5 * kCellM, 1e-9);
}

// Random rooms with doors: walls are where cells are, and every wall's cell has a wall.
TEST(GridWalls, WallsAndCellsCoverEachOther) {
  Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    OccupancyGrid grid = EmptyGrid(220, 180);
    for (int room = 0; room < 6; ++room) {
      const int column = static_cast<int>(random.UniformInt(2, 150)),
                row = static_cast<int>(random.UniformInt(2, 120));
      const int width = static_cast<int>(random.UniformInt(20, 60)),
                height = static_cast<int>(random.UniformInt(20, 50));
      Outline(&grid, column, row, column + width, row + height);
      Fill(&grid, column + 5, row, column + 14, row, CellState::kFree);  // a door
    }
    const auto walls = Walls(grid, {.min_blob_m = 0});
    for (const InputSegment& wall : walls) {
      for (const Vec2& place : {wall.start, wall.end, Vec2(0.5 * (wall.start + wall.end))}) {
        const Vec2 cell = (place / kCellM).array().floor();
        bool is_near = false;
        for (int y = -2; y <= 2; ++y) {
          for (int x = -2; x <= 2; ++x) {
            const int column = static_cast<int>(cell.x()) + x, row = static_cast<int>(cell.y()) + y;
            is_near =
                is_near || (column >= 0 && row >= 0 && column < grid.cells.cols && row < grid.cells.rows &&
                            grid.cells.at<uint8_t>(row, column) == static_cast<int>(CellState::kOccupied));
          }
        }
        EXPECT_TRUE(is_near) << trial << ": " << place.transpose() / kCellM;
      }
    }
    for (int row = 0; row < grid.cells.rows; ++row) {
      for (int column = 0; column < grid.cells.cols; ++column) {
        if (grid.cells.at<uint8_t>(row, column) != static_cast<int>(CellState::kOccupied)) continue;
        EXPECT_LT(DistanceTo(walls, kCellM * Vec2(column + 0.5, row + 0.5)), 4 * kCellM)
            << trial << ": " << column << ", " << row;
      }
    }
  }
}

// As many connected parts and holes as before, and no cell that could go.
TEST(ThinLines, ThinningKeepsWhatIsConnected) {
  Random random(5);
  for (int trial = 0; trial < 50; ++trial) {
    cv::Mat mask = cv::Mat::zeros(60, 60, CV_8U);
    for (int i = 0; i < 12; ++i) {
      const int x = static_cast<int>(random.UniformInt(2, 40)),
                y = static_cast<int>(random.UniformInt(2, 40));
      const int w = static_cast<int>(random.UniformInt(1, 15)),
                h = static_cast<int>(random.UniformInt(1, 15));
      mask(cv::Rect(x, y, w, h)).setTo(255);
    }
    const cv::Mat thinned = Thinned(mask);
    cv::Mat labels;
    EXPECT_EQ(cv::connectedComponents(thinned, labels, 8), cv::connectedComponents(mask, labels, 8));
    EXPECT_EQ(cv::connectedComponents(thinned == 0, labels, 4),
              cv::connectedComponents(mask == 0, labels, 4));
    EXPECT_EQ(cv::countNonZero(thinned & ~mask), 0);
    EXPECT_EQ(cv::countNonZero(Thinned(thinned) != thinned), 0);
  }
}

}  // namespace
}  // namespace cairn::decompose_views
