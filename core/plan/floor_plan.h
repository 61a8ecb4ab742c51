#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"

namespace cairn {

// A point on a plan's grid: whole multiples of FloorPlan::grid_m from FloorPlan::origin.
struct GridPoint {
  int64_t x = 0, y = 0;
  auto operator<=>(const GridPoint&) const = default;
};

// In the plane, in units of the grid.
inline Eigen::Vector2d Real(const GridPoint& point) {
  return {static_cast<double>(point.x), static_cast<double>(point.y)};
}

// Largest coordinate on the grid: products of differences then fit into 64 bits, predicates are exact.
inline constexpr int64_t kMaxGridCoordinate = int64_t{1} << 29;

// Twice the signed area of the triangle abc: > 0 when c lies left of a -> b.  Exact.
inline int64_t Orientation(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// One side of a wall: what a laser sees, and what label sets consist of.  2 * wall is the side to the left of
// start -> end, 2 * wall + 1 the one to the right.
using LabelIdx = int32_t;
inline LabelIdx LabelOf(int32_t wall, bool right_side) { return 2 * wall + (right_side ? 1 : 0); }
inline int32_t WallOf(LabelIdx label) { return label / 2; }
inline bool IsRightSide(LabelIdx label) { return label % 2 != 0; }

// A straight opaque wall without thickness.
struct PlanWall {
  Eigen::Vector2d start, end;  // floor frame, metres

  double Length() const { return (end - start).norm(); }
};

// A part of a wall between two vertices, in the wall's direction.
struct PlanPiece {
  int32_t start = 0, end = 0;  // vertices
  int32_t wall = 0;
};

// Walls seen from above.  Walls are divided into pieces that meet at vertices only.
//   closed plans (polygons with holes): the domain is what lies left of every wall
//   open plans (walls that enclose nothing in particular): the domain is the box from `low` to `high`
struct FloorPlan {
  double grid_m = 1e-5;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // floor frame, metres
  bool closed = false;
  GridPoint low, high;
  std::vector<GridPoint> vertices;
  std::vector<PlanPiece> pieces;  // ascending by wall
  std::vector<PlanWall> walls;

  int num_walls() const { return static_cast<int>(walls.size()); }
  int num_labels() const { return 2 * num_walls(); }
  Eigen::Vector2d Metres(double x, double y) const { return origin + Eigen::Vector2d(x, y) * grid_m; }
  Eigen::Vector2d Metres(const GridPoint& point) const {
    return Metres(static_cast<double>(point.x), static_cast<double>(point.y));
  }
  // Whether a place (metres) lies in the domain; on its border, either.  O(walls).
  bool Contains(const Eigen::Vector2d& place) const;
  // Real-valued grid coordinates.
  Eigen::Vector2d Grid(const Eigen::Vector2d& metres) const { return (metres - origin) / grid_m; }
};

// Direction of a wall as its side is seen: with the side to the left.
inline Eigen::Vector2d LabelStart(const FloorPlan& plan, LabelIdx label) {
  const PlanWall& wall = plan.walls[WallOf(label)];
  return IsRightSide(label) ? wall.end : wall.start;
}
inline Eigen::Vector2d LabelEnd(const FloorPlan& plan, LabelIdx label) {
  const PlanWall& wall = plan.walls[WallOf(label)];
  return IsRightSide(label) ? wall.start : wall.end;
}

// Errors: Corrupt for indices out of range, pieces of no length or coordinates off the grid.
Status CheckFloorPlan(const FloorPlan& plan, const std::string& what);

}  // namespace cairn
