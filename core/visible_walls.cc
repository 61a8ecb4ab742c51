#include "core/visible_walls.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr double kPi = std::numbers::pi;
// Directions closer than this are one, rad.
constexpr double kSameDirection = 1e-11;

struct Side {
  Vec2 start, along;  // relative to the place
  LabelIdx label = 0;
};

// Where a ray meets the line of a side.
Vec2 Meet(const Side& side, const Vec2& direction) {
  return direction * (Cross(side.start, side.along) / Cross(direction, side.along));
}

}  // namespace

std::vector<VisibleStretch> VisibleStretches(const FloorPlan& plan, const std::vector<LabelIdx>& labels,
                                             const Vec2& place) {
  std::vector<Side> sides;
  std::vector<double> angles;
  for (const LabelIdx label : labels) {
    const auto first =
        std::lower_bound(plan.pieces.begin(), plan.pieces.end(), WallOf(label),
                         [](const PlanPiece& piece, int32_t wall) { return piece.wall < wall; });
    for (auto piece = first; piece != plan.pieces.end() && piece->wall == WallOf(label); ++piece) {
      Vec2 start = plan.Metres(plan.vertices[piece->start]) - place;
      Vec2 end = plan.Metres(plan.vertices[piece->end]) - place;
      if (IsRightSide(label)) std::swap(start, end);
      if (Cross(start, end) <= 0) continue;
      sides.push_back({start, end - start, label});
      angles.push_back(std::atan2(start.y(), start.x()));
      angles.push_back(std::atan2(end.y(), end.x()));
    }
  }
  std::sort(angles.begin(), angles.end());
  std::vector<VisibleStretch> stretches;
  if (angles.empty()) return stretches;
  bool open = false;  // the last stretch goes on to the direction before
  for (size_t i = 0; i < angles.size(); ++i) {
    const double from = angles[i], to = i + 1 < angles.size() ? angles[i + 1] : angles[0] + 2 * kPi;
    if (to - from < kSameDirection) continue;
    const double middle = 0.5 * (from + to);
    const Vec2 direction(std::cos(middle), std::sin(middle));
    const Side* nearest = nullptr;
    double nearest_distance = std::numeric_limits<double>::infinity();
    for (const Side& side : sides) {
      if (Cross(side.start, direction) < 0 || Cross(direction, side.start + side.along) < 0) continue;
      const double distance = Cross(side.start, side.along) / Cross(direction, side.along);
      if (distance <= 0 || distance >= nearest_distance) continue;
      nearest = &side;
      nearest_distance = distance;
    }
    if (nearest == nullptr) {
      open = false;
      continue;
    }
    const Vec2 start = Meet(*nearest, {std::cos(from), std::sin(from)}) + place;
    const Vec2 end = Meet(*nearest, {std::cos(to), std::sin(to)}) + place;
    if (open && stretches.back().label == nearest->label) {
      stretches.back().end = end;
    } else {
      stretches.push_back({nearest->label, start, end});
    }
    open = true;
  }
  // The first and the last may be one.
  if (stretches.size() > 1 && open && stretches.front().label == stretches.back().label &&
      (stretches.front().start - stretches.back().end).norm() < 1e-6) {
    stretches.front().start = stretches.back().start;
    stretches.pop_back();
  }
  return stretches;
}

}  // namespace cairn
