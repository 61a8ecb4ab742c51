#include "runtime/plan_space.h"

#include <algorithm>
#include <cmath>

#include "core/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

double PointToSegment(const Vec2& point, const Vec2& a, const Vec2& b) {
  const Vec2 along = b - a;
  const double squared = along.squaredNorm();
  const double share = squared > 0 ? std::clamp((point - a).dot(along) / squared, 0.0, 1.0) : 0;
  return (point - a - share * along).norm();
}

}  // namespace

void PlanSpace::ListNeighbours() {
  for (const ViewLink& link : views_.links) {
    ++neighbour_offsets_[link.a + 1];
    ++neighbour_offsets_[link.b + 1];
  }
  for (FaceIdx face = 0; face < views_.num_faces(); ++face)
    neighbour_offsets_[face + 1] += neighbour_offsets_[face];
  neighbours_.resize(neighbour_offsets_.back());
  std::vector<int64_t> next(neighbour_offsets_.begin(), neighbour_offsets_.end() - 1);
  for (const ViewLink& link : views_.links) {
    const Vec2 middle = 0.5 * (views_.plan.Metres(views_.vertices[link.start]) +
                               views_.plan.Metres(views_.vertices[link.end]));
    neighbours_[next[link.a]++] = {link.b, middle};
    neighbours_[next[link.b]++] = {link.a, middle};
  }
}

Status PlanSpace::CheckInside(const Eigen::Vector2d& place) const {
  if (FaceAt(place) >= 0) return Ok();
  return MakeError(ErrorCode::kInvalidArgument, "the place ({:g}, {:g}) lies in no region of the plan",
                   place.x(), place.y());
}

std::vector<VisibleStretch> PlanSpace::ViewFrom(const Vec2& place) const {
  const FaceIdx face = FaceAt(place);
  if (face < 0) return {};
  return VisibleStretches(views_.plan, views_.LabelSet(face), place);
}

void PlanSpace::ListWalls() {
  const FloorPlan& plan = views_.plan;
  low_ = plan.Metres(plan.low);
  const Vec2 size = (plan.Metres(plan.high) - low_).cwiseMax(1e-3);
  cell_m_ = std::max(std::sqrt(size.x() * size.y() / std::max(1, plan.num_walls())), size.maxCoeff() / 1024);
  num_columns_ = static_cast<int>(size.x() / cell_m_) + 1;
  num_rows_ = static_cast<int>(size.y() / cell_m_) + 1;
  cell_walls_.resize(static_cast<size_t>(num_columns_) * num_rows_);
  for (int32_t wall = 0; wall < plan.num_walls(); ++wall) {
    VisitCells(plan.walls[wall].start, plan.walls[wall].end, 1e-3, [&](size_t cell) {
      cell_walls_[cell].push_back(wall);
      return true;
    });
  }
}

template <typename Visit>
bool PlanSpace::VisitCells(const Vec2& a, const Vec2& b, double radius_m, Visit&& visit) const {
  const auto column = [&](double x) {
    return std::clamp(static_cast<int>((x - low_.x()) / cell_m_), 0, num_columns_ - 1);
  };
  const auto row = [&](double y) {
    return std::clamp(static_cast<int>((y - low_.y()) / cell_m_), 0, num_rows_ - 1);
  };
  const Vec2 &left = a.x() <= b.x() ? a : b, &right = a.x() <= b.x() ? b : a;
  const double slope = right.x() > left.x() ? (right.y() - left.y()) / (right.x() - left.x()) : 0;
  for (int c = column(left.x() - radius_m); c <= column(right.x() + radius_m); ++c) {
    double from = std::min(a.y(), b.y()), to = std::max(a.y(), b.y());
    if (right.x() - left.x() > 1e-9) {
      const double x0 = std::clamp(low_.x() + c * cell_m_ - radius_m, left.x(), right.x());
      const double x1 = std::clamp(low_.x() + (c + 1) * cell_m_ + radius_m, left.x(), right.x());
      const double y0 = left.y() + slope * (x0 - left.x()), y1 = left.y() + slope * (x1 - left.x());
      from = std::min(y0, y1);
      to = std::max(y0, y1);
    }
    for (int r = row(from - radius_m); r <= row(to + radius_m); ++r) {
      if (!visit(static_cast<size_t>(r) * num_columns_ + c)) return false;
    }
  }
  return true;
}

bool PlanSpace::IsFree(const Vec2& a, const Vec2& b, double radius_m) const {
  const Vec2 along = b - a;
  return VisitCells(a, b, radius_m + 1e-3, [&](size_t cell) {
    for (const int32_t index : cell_walls_[cell]) {
      const PlanWall& wall = views_.plan.walls[index];
      const Vec2 wall_along = wall.end - wall.start;
      const double side_start = Cross(along, wall.start - a), side_end = Cross(along, wall.end - a);
      const double side_a = Cross(wall_along, a - wall.start), side_b = Cross(wall_along, b - wall.start);
      if (side_start * side_end < 0 && side_a * side_b < 0) return false;
      if (radius_m <= 0) continue;
      const double nearest =
          std::min({PointToSegment(a, wall.start, wall.end), PointToSegment(b, wall.start, wall.end),
                    PointToSegment(wall.start, a, b), PointToSegment(wall.end, a, b)});
      if (nearest < radius_m) return false;
    }
    return true;
  });
}

}  // namespace cairn
