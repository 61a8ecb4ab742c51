#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"

namespace cairn {

// Cells of a grid, from `low` on; in metres, or in whatever the walls are.
struct CellGrid {
  Eigen::Vector2d low = Eigen::Vector2d::Zero();  // metres
  double cell_m = 1;
  int num_columns = 0, num_rows = 0;

  size_t size() const { return static_cast<size_t>(num_columns) * num_rows; }
  size_t Index(int column, int row) const { return static_cast<size_t>(row) * num_columns + column; }
  // Of a place; may lie outside.
  Eigen::Vector2i CellOf(const Eigen::Vector2d& place) const {
    return ((place - low) / cell_m).array().floor().cast<int>();
  }
  bool Has(const Eigen::Vector2i& cell) const {
    return cell.x() >= 0 && cell.y() >= 0 && cell.x() < num_columns && cell.y() < num_rows;
  }
  Eigen::Vector2d Middle(int column, int row) const {
    return low + cell_m * Eigen::Vector2d(column + 0.5, row + 0.5);
  }
};

// Width and height of the box around walls, metres; NaN or infinite where one of theirs is.
Eigen::Vector2d ExtentOf(const std::vector<PlanWall>& walls);

// The grid around walls, `margin_m` wider, of cells of `cell_m`, or larger ones where more than
// `max_num_cells` would be needed.
CellGrid GridAround(const std::vector<PlanWall>& walls, double margin_m, double cell_m, double max_num_cells);

// Calls visit(column, row) for all cells that come within `reach_m` of a wall, and some more.
template <typename Visit>
void ForCellsNear(const CellGrid& grid, const PlanWall& wall, double reach_m, Visit&& visit) {
  const Eigen::Vector2d from = wall.start.x() <= wall.end.x() ? wall.start : wall.end;
  const Eigen::Vector2d along = (wall.start.x() <= wall.end.x() ? wall.end : wall.start) - from;
  const auto cell_of = [&](double metres, double low, int num) {
    return std::clamp(static_cast<int>(std::floor((metres - low) / grid.cell_m)), 0, num - 1);
  };
  const int last = cell_of(from.x() + along.x() + reach_m, grid.low.x(), grid.num_columns);
  for (int column = cell_of(from.x() - reach_m, grid.low.x(), grid.num_columns); column <= last; ++column) {
    // The part of the wall that lies in the column and within reach beside it.
    const double left = grid.low.x() + column * grid.cell_m - reach_m - from.x();
    const double right = left + grid.cell_m + 2 * reach_m;
    double a = 0, b = 1;
    if (along.x() > 0) {
      a = std::clamp(left / along.x(), 0.0, 1.0);
      b = std::clamp(right / along.x(), 0.0, 1.0);
    }
    const double y_a = from.y() + a * along.y(), y_b = from.y() + b * along.y();
    const int top = cell_of(std::max(y_a, y_b) + reach_m, grid.low.y(), grid.num_rows);
    for (int row = cell_of(std::min(y_a, y_b) - reach_m, grid.low.y(), grid.num_rows); row <= top; ++row)
      visit(column, row);
  }
}

// The walls that come near to each cell of a grid.
class WallsByCell {
 public:
  WallsByCell() = default;
  // Those within `reach` of a cell, and some more.
  WallsByCell(const CellGrid& grid, const std::vector<PlanWall>& walls, double reach);

  // Ascending.
  std::span<const int32_t> At(size_t cell) const {
    return std::span(walls_).subspan(offsets_[cell], offsets_[cell + 1] - offsets_[cell]);
  }

 private:
  std::vector<int64_t> offsets_;
  std::vector<int32_t> walls_;  // cell i: walls_[offsets_[i] .. offsets_[i + 1])
};

}  // namespace cairn
