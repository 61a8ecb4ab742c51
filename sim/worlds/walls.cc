#include "sim/worlds/walls.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/vector_geometry.h"

namespace cairn::sim {

bool Contains(const Polygon& polygon, const Eigen::Vector2d& point) {
  bool inside = false;
  for (size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[j];
    if ((a.y() > point.y()) == (b.y() > point.y())) continue;
    if (point.x() < a.x() + (b.x() - a.x()) * (point.y() - a.y()) / (b.y() - a.y())) inside = !inside;
  }
  return inside;
}

bool SegmentsCross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                   const Eigen::Vector2d& d) {
  const double a_side = Cross(d - c, a - c), b_side = Cross(d - c, b - c);
  const double c_side = Cross(b - a, c - a), d_side = Cross(b - a, d - a);
  return a_side * b_side <= 0 && c_side * d_side <= 0;
}

WallIndex::WallIndex(const std::vector<Polygon>& polygons, double cell_m) : cell_m_(cell_m) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& vertex : polygons[0]) box.extend(vertex);
  origin_ = box.min();
  num_columns_ = static_cast<int>(box.sizes().x() / cell_m) + 1;
  num_rows_ = static_cast<int>(box.sizes().y() / cell_m) + 1;
  cells_.resize(static_cast<size_t>(num_columns_) * num_rows_);
  for (const Polygon& polygon : polygons) Add(polygon);
}

std::pair<int, int> WallIndex::CellOf(const Eigen::Vector2d& point) const {
  const Eigen::Vector2d cell = (point - origin_) / cell_m_;
  return {std::clamp(static_cast<int>(std::floor(cell.x())), 0, num_columns_ - 1),
          std::clamp(static_cast<int>(std::floor(cell.y())), 0, num_rows_ - 1)};
}

template <typename Visit>
void WallIndex::VisitCells(const Eigen::AlignedBox2d& box, Visit&& visit) const {
  const auto [min_column, min_row] = CellOf(box.min());
  const auto [max_column, max_row] = CellOf(box.max());
  for (int row = min_row; row <= max_row; ++row) {
    for (int column = min_column; column <= max_column; ++column) {
      visit(static_cast<size_t>(row) * num_columns_ + column);
    }
  }
}

void WallIndex::Add(const Polygon& polygon) {
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Wall wall(polygon[i], polygon[(i + 1) % polygon.size()]);
    const auto idx = static_cast<int32_t>(walls_.size());
    walls_.push_back(wall);
    // In pieces of a cell's length, so that a long diagonal wall is not in every cell of its box.
    const int num_pieces = static_cast<int>((wall.second - wall.first).norm() / cell_m_) + 1;
    for (int piece = 0; piece < num_pieces; ++piece) {
      const Eigen::Vector2d step = (wall.second - wall.first) / num_pieces;
      Eigen::AlignedBox2d box(wall.first + piece * step);
      box.extend(wall.first + (piece + 1) * step);
      VisitCells(box, [&](size_t cell) { cells_[cell].push_back(idx); });
    }
  }
}

std::vector<WallIndex::Wall> WallIndex::Near(const Eigen::AlignedBox2d& box) const {
  std::vector<int32_t> found;
  VisitCells(box, [&](size_t cell) { found.insert(found.end(), cells_[cell].begin(), cells_[cell].end()); });
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  std::vector<Wall> walls;
  for (const int32_t idx : found) walls.push_back(walls_[idx]);
  return walls;
}

bool WallIndex::AnyWithin(const Eigen::Vector2d& point, double distance_m) const {
  const Eigen::Vector2d reach(distance_m, distance_m);
  const std::vector<Wall> walls = Near(Eigen::AlignedBox2d(point - reach, point + reach));
  return std::any_of(walls.begin(), walls.end(), [&](const Wall& wall) {
    return PointToSegment(point, wall.first, wall.second) <= distance_m;
  });
}

}  // namespace cairn::sim
