#include "core/view_regions/nearby_plan.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/vector_geometry.h"

namespace cairn {

NearbyPlan PlanNear(const FloorPlan& plan, std::span<const Eigen::Vector2d> places, double reach_m) {
  NearbyPlan near;
  near.plan.grid_m = plan.grid_m;
  near.plan.origin = plan.origin;
  std::vector<int32_t> part_of(plan.walls.size(), -1);
  for (int32_t wall = 0; wall < plan.num_walls(); ++wall) {
    const PlanWall& at = plan.walls[wall];
    const bool is_near = std::any_of(places.begin(), places.end(), [&](const Eigen::Vector2d& place) {
      return PointToSegment(place, at.start, at.end) <= reach_m;
    });
    if (!is_near) continue;
    part_of[wall] = static_cast<int32_t>(near.walls.size());
    near.walls.push_back(wall);
    near.plan.walls.push_back(at);
  }
  std::vector<int32_t> vertex_of(plan.vertices.size(), -1);
  const auto keep = [&](int32_t vertex) {
    if (vertex_of[vertex] < 0) {
      vertex_of[vertex] = static_cast<int32_t>(near.plan.vertices.size());
      near.plan.vertices.push_back(plan.vertices[vertex]);
    }
    return vertex_of[vertex];
  };
  for (const PlanPiece& piece : plan.pieces) {
    if (part_of[piece.wall] < 0) continue;
    const int32_t start = keep(piece.start), end = keep(piece.end);
    near.plan.pieces.push_back({start, end, part_of[piece.wall]});
  }
  bool is_empty = true;
  const auto include = [&](const GridPoint& point) {
    FloorPlan& part = near.plan;
    part.low = is_empty ? point : GridPoint{std::min(part.low.x, point.x), std::min(part.low.y, point.y)};
    part.high = is_empty ? point : GridPoint{std::max(part.high.x, point.x), std::max(part.high.y, point.y)};
    is_empty = false;
  };
  for (const GridPoint& vertex : near.plan.vertices) include(vertex);
  for (const Eigen::Vector2d& place : places) {
    for (const double side : {-reach_m, reach_m}) {
      const Eigen::Vector2d corner = plan.Grid(place + Eigen::Vector2d(side, side));
      const auto within = [](double at, int64_t low, int64_t high) {
        return static_cast<int64_t>(
            std::clamp(std::round(at), static_cast<double>(low), static_cast<double>(high)));
      };
      include({within(corner.x(), plan.low.x, plan.high.x), within(corner.y(), plan.low.y, plan.high.y)});
    }
  }
  return near;
}

}  // namespace cairn
