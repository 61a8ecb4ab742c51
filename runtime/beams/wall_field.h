#pragma once

#include <cstdint>
#include <vector>

#include "core/plan/wall_cells.h"

namespace cairn {

// How well the end of a beam would fit a plan, by place: 255 exp(-d^2 / 2 sigma^2) where the nearest wall is
// d away (the likelihood field of Thrun, Burgard and Fox: Probabilistic Robotics, 6.4), and the best of it in
// ever larger windows, by which a search leaves out places (Hess et al. 2016: Real-Time Loop Closure in 2D
// LIDAR SLAM, V).  Of all walls, and of those of about one direction each: where the direction of what a beam
// met is known, few walls fit by chance (after Liu et al. 2010: Fast Directional Chamfer Matching).
class WallField {
 public:
  // Windows of up to 2^kTopLevel cells a side.
  static constexpr int kTopLevel = 6;
  // Layers of walls of about one direction, and that of all.
  static constexpr int kNumDirections = 4;
  static constexpr int kAllWalls = kNumDirections;

  // `walls` outlives this.  Cells of 0.1 m, or larger ones of a plan of more than 20,000 m^2: 40 bytes each.
  // O(cells * levels * layers + walls)
  explicit WallField(const std::vector<PlanWall>& walls);

  const CellGrid& grid() const { return grid_; }
  // The layer of walls in a direction, radians, either way.
  static int LayerOf(double angle_rad);
  // The best in the window of 2^level cells a side from a cell on, which may lie outside.
  int Best(int layer, int level, int column, int row) const {
    const int size = 1 << level;
    if (column <= -size || row <= -size || column >= grid_.num_columns || row >= grid_.num_rows) return 0;
    // A window that begins outside: that from the border on has all of it.
    return layers_[layer][level][grid_.Index(column < 0 ? 0 : column, row < 0 ? 0 : row)];
  }
  // The wall nearest to a place's cell; -1: none near.
  int32_t NearestWall(const Eigen::Vector2d& place) const {
    const Eigen::Vector2i cell = grid_.CellOf(place);
    return grid_.Has(cell) ? nearest_[grid_.Index(cell.x(), cell.y())] : -1;
  }
  // Beyond this from a wall the field is 0, metres.
  double reach_m() const { return reach_m_; }

 private:
  using Levels = std::vector<std::vector<uint8_t>>;
  // Of the squared distances to the nearest wall, square metres.
  Levels LevelsOf(const std::vector<float>& squared, double sigma_m) const;

  const CellGrid grid_;
  double reach_m_ = 0;
  std::vector<Levels> layers_;
  std::vector<int32_t> nearest_;
};

}  // namespace cairn
