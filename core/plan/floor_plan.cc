#include "core/plan/floor_plan.h"

#include <cmath>
#include <cstdlib>

namespace cairn {

bool FloorPlan::Contains(const Eigen::Vector2d& place) const {
  if (!closed) {
    const Eigen::Vector2d from = Metres(low), to = Metres(high);
    return (place.array() >= from.array()).all() && (place.array() <= to.array()).all();
  }
  // Walls bound it: a ray along x leaves it once more than it enters.
  bool inside = false;
  for (const PlanWall& wall : walls) {
    if ((wall.start.y() > place.y()) == (wall.end.y() > place.y())) continue;
    const double share = (place.y() - wall.start.y()) / (wall.end.y() - wall.start.y());
    if (wall.start.x() + share * (wall.end.x() - wall.start.x()) > place.x()) inside = !inside;
  }
  return inside;
}

Status CheckFloorPlan(const FloorPlan& plan, const std::string& what) {
  if (!(plan.grid_m > 0) || !std::isfinite(plan.grid_m) || !plan.origin.allFinite())
    return Corrupt(what, "the plan's grid is not a grid");
  const auto on_grid = [](const GridPoint& point) {
    return std::abs(point.x) <= kMaxGridCoordinate && std::abs(point.y) <= kMaxGridCoordinate;
  };
  for (const GridPoint& vertex : plan.vertices) {
    if (!on_grid(vertex)) return Corrupt(what, "vertex ({}, {}) is off the grid", vertex.x, vertex.y);
  }
  const auto num_vertices = static_cast<int32_t>(plan.vertices.size());
  int32_t last_wall = 0;
  for (const PlanPiece& piece : plan.pieces) {
    if (piece.wall < last_wall) return Corrupt(what, "pieces of walls are out of order");
    last_wall = piece.wall;
    if (piece.start < 0 || piece.end < 0 || piece.start >= num_vertices || piece.end >= num_vertices ||
        piece.start == piece.end || piece.wall < 0 || piece.wall >= plan.num_walls()) {
      return Corrupt(what, "a piece of wall {} joins vertices {} and {} of {}", piece.wall, piece.start,
                     piece.end, num_vertices);
    }
  }
  for (const PlanWall& wall : plan.walls) {
    if (!wall.start.allFinite() || !wall.end.allFinite() || wall.Length() <= 0) {
      return Corrupt(what, "a wall has no length");
    }
  }
  return Ok();
}

}  // namespace cairn
