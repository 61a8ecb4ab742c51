#include "core/plan/visible_walls.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr double kPi = std::numbers::pi;
// Directions closer than this count as equal, rad.
constexpr double kSameDirection = 1e-11;

struct Side {
  Vec2 start, along;  // relative to the place
  LabelIdx label = 0;
};

// A direction in which a side begins or ends, counter-clockwise.
struct Event {
  double angle;  // (-pi, pi]
  int side;
  bool begins;
};

Vec2 Towards(const std::vector<Side>& sides, const Event& event) {
  const Side& side = sides[event.side];
  return event.begins ? side.start : side.start + side.along;
}

// Where a ray meets the line of a side.
Vec2 Meet(const Side& side, const Vec2& direction) {
  return direction * (Cross(side.start, side.along) / Cross(direction, side.along));
}

}  // namespace

std::vector<VisibleStretch> VisibleStretches(const FloorPlan& plan, const std::vector<LabelIdx>& labels,
                                             const Vec2& place) {
  std::vector<Side> sides;
  std::vector<Event> events;
  for (const LabelIdx label : labels) {
    const auto first =
        std::lower_bound(plan.pieces.begin(), plan.pieces.end(), WallOf(label),
                         [](const PlanPiece& piece, int32_t wall) { return piece.wall < wall; });
    for (auto piece = first; piece != plan.pieces.end() && piece->wall == WallOf(label); ++piece) {
      Vec2 start = plan.Metres(plan.vertices[piece->start]) - place;
      Vec2 end = plan.Metres(plan.vertices[piece->end]) - place;
      if (IsRightSide(label)) std::swap(start, end);
      if (Cross(start, end) <= 0) continue;
      const auto side = static_cast<int>(sides.size());
      sides.push_back({start, end - start, label});
      events.push_back({std::atan2(start.y(), start.x()), side, true});
      events.push_back({std::atan2(end.y(), end.x()), side, false});
    }
  }
  std::vector<VisibleStretch> stretches;
  if (events.empty()) return stretches;
  // Sides in the direction that the sweep has come to; it begins at the direction of -x.
  std::vector<int> ahead;
  for (size_t i = 0; i < sides.size(); ++i) {
    if (events[2 * i + 1].angle < events[2 * i].angle) ahead.push_back(static_cast<int>(i));
  }
  std::sort(events.begin(), events.end(), [](const Event& a, const Event& b) {
    return std::tie(a.angle, a.side) < std::tie(b.angle, b.side);
  });
  bool open = false;  // the last stretch goes on to the direction before
  for (size_t i = 0; i < events.size(); ++i) {
    const Event &event = events[i], &next = events[i + 1 < events.size() ? i + 1 : 0];
    if (event.begins) {
      ahead.push_back(event.side);
    } else {
      std::erase(ahead, event.side);
    }
    const double to = i + 1 < events.size() ? next.angle : next.angle + 2 * kPi;
    if (to - event.angle < kSameDirection) continue;
    const double middle = 0.5 * (event.angle + to);
    const Vec2 direction(std::cos(middle), std::sin(middle));
    // [Simsarian96 §2] of the edges in a direction the nearest is visible
    const Side* nearest = nullptr;
    double nearest_distance = std::numeric_limits<double>::infinity();
    for (const int index : ahead) {
      const Side& side = sides[index];
      const double distance = Cross(side.start, side.along) / Cross(direction, side.along);
      if (distance <= 0 || distance >= nearest_distance) continue;
      nearest = &side;
      nearest_distance = distance;
    }
    if (nearest == nullptr) {
      open = false;
      continue;
    }
    const Vec2 start = Meet(*nearest, Towards(sides, event)) + place;
    const Vec2 end = Meet(*nearest, Towards(sides, next)) + place;
    if (open && stretches.back().label == nearest->label) {
      stretches.back().end = end;
    } else {
      stretches.push_back({nearest->label, start, end});
    }
    open = true;
  }
  // The first and the last may be the same stretch.
  if (stretches.size() > 1 && open && stretches.front().label == stretches.back().label &&
      (stretches.front().start - stretches.back().end).norm() < 1e-6) {
    stretches.front().start = stretches.back().start;
    stretches.pop_back();
  }
  return stretches;
}

}  // namespace cairn
