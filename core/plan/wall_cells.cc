#include "core/plan/wall_cells.h"

#include <limits>
#include <utility>

namespace cairn {

using Vec2 = Eigen::Vector2d;

namespace {

std::pair<Vec2, Vec2> BoxAround(const std::vector<PlanWall>& walls) {
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const PlanWall& wall : walls) {
    low = low.cwiseMin(wall.start).cwiseMin(wall.end);
    high = high.cwiseMax(wall.start).cwiseMax(wall.end);
  }
  if (walls.empty()) low = high = Vec2::Zero();
  return {low, high};
}

}  // namespace

Vec2 ExtentOf(const std::vector<PlanWall>& walls) {
  const auto [low, high] = BoxAround(walls);
  return high - low;
}

CellGrid GridAround(const std::vector<PlanWall>& walls, double margin_m, double cell_m,
                    double max_num_cells) {
  CellGrid grid;
  const auto [low, high] = BoxAround(walls);
  grid.low = low.array() - margin_m;
  const Vec2 size = (high - low).array() + 2 * margin_m;
  // Also so that neither side alone is too long.
  grid.cell_m = std::max({cell_m, std::sqrt(size.prod() / max_num_cells), size.maxCoeff() / max_num_cells});
  grid.num_columns = static_cast<int>(size.x() / grid.cell_m) + 1;
  grid.num_rows = static_cast<int>(size.y() / grid.cell_m) + 1;
  return grid;
}

WallsByCell::WallsByCell(const CellGrid& grid, const std::vector<PlanWall>& walls, double reach)
    : offsets_(grid.size() + 1, 0) {
  for (const PlanWall& wall : walls)
    ForCellsNear(grid, wall, reach, [&](int column, int row) { ++offsets_[grid.Index(column, row) + 1]; });
  for (size_t i = 1; i < offsets_.size(); ++i) offsets_[i] += offsets_[i - 1];
  walls_.resize(offsets_.back());
  std::vector<int64_t> next(offsets_.begin(), offsets_.end() - 1);
  for (int32_t i = 0; i < std::ssize(walls); ++i) {
    ForCellsNear(grid, walls[i], reach,
                 [&](int column, int row) { walls_[next[grid.Index(column, row)]++] = i; });
  }
}

}  // namespace cairn
