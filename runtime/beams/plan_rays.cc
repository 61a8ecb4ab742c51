#include "runtime/beams/plan_rays.h"

#include <array>
#include <limits>
#include <utility>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double kRayCellM = 0.5;
constexpr double kMaxRayCells = 1 << 20;
// Walls on a border of cells belong to both, metres.
constexpr double kBorder = 1e-6;

void InsertHit(const PlanRays::Hit& hit, PlanRays::Hits* hits) {
  for (const PlanRays::Hit& other : *hits) {
    if (other.wall == hit.wall) return;
  }
  int place = hits->size;
  if (place == PlanRays::kMaxHits) {
    if (hits->at.back().distance_m <= hit.distance_m) return;
    --place;
  } else {
    ++hits->size;
  }
  for (; place > 0 && hits->at[place - 1].distance_m > hit.distance_m; --place)
    hits->at[place] = hits->at[place - 1];
  hits->at[place] = hit;
}

}  // namespace

PlanRays::PlanRays(const std::vector<PlanWall>& walls)
    : walls_(walls),
      grid_(GridAround(walls, kRayCellM, kRayCellM, kMaxRayCells)),
      by_cell_(grid_, walls, kBorder) {}

PlanRays::Hits PlanRays::Cast(const Vec2& origin, const Vec2& direction, double reach_m) const {
  Hits hits;
  const std::array<int, 2> num_cells = {grid_.num_columns, grid_.num_rows};
  const Vec2 size(num_cells[0] * grid_.cell_m, num_cells[1] * grid_.cell_m);
  double enter = 0, leave = reach_m;
  for (int axis = 0; axis < 2; ++axis) {
    const double from = origin[axis] - grid_.low[axis];
    if (direction[axis] == 0) {
      if (from < 0 || from >= size[axis]) return hits;
      continue;
    }
    double a = -from / direction[axis], b = (size[axis] - from) / direction[axis];
    if (a > b) std::swap(a, b);
    enter = std::max(enter, a);
    leave = std::min(leave, b);
  }
  if (!(enter < leave)) return hits;
  // Cell by cell (Amanatides and Woo 1987).
  const Vec2 entry = origin + enter * direction - grid_.low;
  int cell[2];
  double next[2], step[2];  // distances at which the ray leaves the cell, by axis
  for (int axis = 0; axis < 2; ++axis) {
    cell[axis] = std::clamp(static_cast<int>(entry[axis] / grid_.cell_m), 0, num_cells[axis] - 1);
    const double border = (cell[axis] + (direction[axis] > 0 ? 1 : 0)) * grid_.cell_m + grid_.low[axis];
    const bool moves = direction[axis] != 0;
    next[axis] = moves ? (border - origin[axis]) / direction[axis] : std::numeric_limits<double>::infinity();
    step[axis] = moves ? grid_.cell_m / std::abs(direction[axis]) : 0;
  }
  while (true) {
    const int axis = next[0] < next[1] ? 0 : 1;
    const double end = std::min(next[axis], leave);
    for (const int32_t wall_idx : by_cell_.At(grid_.Index(cell[0], cell[1]))) {
      const PlanWall& wall = walls_[wall_idx];
      const Vec2 to_start = wall.start - origin, along = wall.end - wall.start;
      const double side_a = Cross(direction, to_start), side_b = Cross(direction, wall.end - origin);
      if ((side_a > 0) == (side_b > 0)) continue;
      const double distance = Cross(to_start, along) / Cross(direction, along);
      // Beyond the cell it is found in its own, nearer ones first.
      if (distance > 0 && distance <= end + kBorder && distance <= reach_m)
        InsertHit({distance, wall_idx}, &hits);
    }
    if (hits.size == kMaxHits || end >= leave) return hits;
    next[axis] += step[axis];
    cell[axis] += direction[axis] > 0 ? 1 : -1;
    if (cell[axis] < 0 || cell[axis] >= num_cells[axis]) return hits;
  }
}

}  // namespace cairn
