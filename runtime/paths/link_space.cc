#include "runtime/paths/link_space.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
// Greatest angle between neighbours of the points around a corner.
constexpr double kChainStep = std::numbers::pi / 16;
// How much kOuter leaves and kInner adds to the radius of a disc, metres: more than all rounding.
constexpr double kMarginM = 1e-6;
// What kInner of a point keeps away from walls, units of the grid: places are rounded to it.
constexpr double kPointMargin = 4;

Vec2 Towards(double angle) { return {std::cos(angle), std::sin(angle)}; }

double Wrapped(double angle) {
  while (angle > std::numbers::pi) angle -= 2 * std::numbers::pi;
  while (angle < -std::numbers::pi) angle += 2 * std::numbers::pi;
  return angle;
}

// How far counter-clockwise from one direction to another, in [0, 2 pi).
double TurnTo(double from, double to) {
  const double turn = std::fmod(to - from, 2 * std::numbers::pi);
  return turn < 0 ? turn + 2 * std::numbers::pi : turn;
}

bool MeetsRange(const std::vector<DirectionRange>& ranges, double from, double to) {
  return std::any_of(ranges.begin(), ranges.end(), [&](const DirectionRange& range) {
    return TurnTo(range.from, from) <= range.width || TurnTo(from, range.from) <= to - from;
  });
}

void KeepWithin(const std::vector<DirectionRange>& ranges, std::vector<BlockedArc>* arcs) {
  std::erase_if(*arcs, [&](const BlockedArc& arc) { return !MeetsRange(ranges, arc.from, arc.to); });
}

}  // namespace

std::vector<DirectionRange> LinkDirections(const LinkSpace::Corner& corner) {
  constexpr double kRounding = 2e-9;
  const double width = corner.free_angle - std::numbers::pi + 2 * kRounding;
  return {{Wrapped(corner.from - kRounding), width},
          {Wrapped(corner.from + std::numbers::pi - kRounding), width}};
}

LinkSpace::LinkSpace(const PlanSpace& space, double radius_m, Bound bound, const Vec2& from, const Vec2& to)
    : space_(space),
      plan_(space.views().plan),
      touches_(bound == Bound::kOuter && radius_m <= 0),
      from_(plan_.Grid(from)),
      to_(plan_.Grid(to)) {
  if (radius_m <= 0) {
    from_ = from_.array().round();
    to_ = to_.array().round();
  }
  if (touches_) {
    for (const WallCorner& corner : space.corners()) {
      const double first = AngleOf(Real(corner.first) - Real(corner.vertex));
      double free_angle = AngleOf(Real(corner.last) - Real(corner.vertex)) - first;
      if (free_angle <= 0) free_angle += 2 * std::numbers::pi;
      corners_.push_back({Real(corner.vertex), first, free_angle});
    }
    AddBox(1);
    return;
  }
  const bool outer = bound == Bound::kOuter;
  const double margin = std::min(kMarginM, 0.5 * radius_m);
  AddGrown(outer ? radius_m - margin : radius_m > 0 ? radius_m + margin : kPointMargin * plan_.grid_m, outer);
  AddBox(outer ? 1 : 0);
}

void LinkSpace::AddBox(double margin) {
  const Vec2 low = Real(plan_.low).array() - margin, high = Real(plan_.high).array() + margin;
  const Vec2 right(high.x(), low.y()), left(low.x(), high.y());
  for (const auto& [start, end] :
       {std::pair(low, right), std::pair(right, high), std::pair(high, left), std::pair(left, low)})
    segments_.push_back({start, end});
}

void LinkSpace::AddGrown(double radius_m, bool outer) {
  const double radius = radius_m / plan_.grid_m;
  // As far as the polygons around corners come from them.
  const double farthest = outer ? 0 : radius / std::cos(0.5 * kChainStep) + 1;
  const auto covers = [&](const Vec2& start, const Vec2& end) {
    return !outer && std::min(PointToSegment(from_, start, end), PointToSegment(to_, start, end)) < farthest;
  };
  for (const PlanPiece& piece : plan_.pieces) {
    const Vec2 start = Real(plan_.vertices[piece.start]), end = Real(plan_.vertices[piece.end]);
    if (covers(start, end)) {
      segments_.push_back({start, end});
      continue;
    }
    const Vec2 along = (end - start).normalized();
    const Vec2 left = radius * Vec2(-along.y(), along.x());
    segments_.push_back({start + left, end + left});
    // The domain of closed plans lies left of walls.
    if (!plan_.closed) segments_.push_back({start - left, end - left});
  }
  for (const WallCorner& gap : space_.gaps()) {
    const Vec2 vertex = Real(gap.vertex);
    if (!covers(vertex, vertex)) AddChain(gap, radius, outer, radius_m);
  }
}

// Joins what two neighbouring walls of a vertex are grown to: around it, where it is a corner.
void LinkSpace::AddChain(const WallCorner& gap, double radius, bool outer, double radius_m) {
  const Vec2 vertex = Real(gap.vertex);
  const double first = AngleOf(Real(gap.first) - vertex);
  double free_angle = AngleOf(Real(gap.last) - vertex) - first;
  if (free_angle <= 0) free_angle += 2 * std::numbers::pi;
  const double turn = free_angle - std::numbers::pi;
  std::vector<Vec2> chain{vertex + radius * Towards(first + 0.5 * std::numbers::pi)};
  const Vec2 rim_end = vertex + radius * Towards(first + 0.5 * std::numbers::pi + turn);
  double half_step = 0;
  if (turn > 0) {
    const int num_steps = static_cast<int>(std::ceil(turn / kChainStep));
    half_step = 0.5 * turn / num_steps;
    if (outer) {
      for (int k = 1; k < num_steps; ++k)
        chain.push_back(vertex + radius * Towards(first + 0.5 * std::numbers::pi + 2 * k * half_step));
    } else {
      for (int k = 0; k < num_steps; ++k)
        chain.push_back(vertex + radius / std::cos(half_step) *
                                     Towards(first + 0.5 * std::numbers::pi + (2 * k + 1) * half_step));
    }
  }
  chain.push_back(rim_end);
  for (size_t i = 0; i + 1 < chain.size(); ++i) segments_.push_back({chain[i], chain[i + 1]});
  if (turn <= 0) return;
  // Nearer than this to a wall is inside of what it is grown to.
  const double free_m =
      outer ? radius_m * std::cos(half_step) - std::min(kMarginM, 0.1 * radius_m) : radius_m;
  for (size_t i = 0; i < chain.size(); ++i) {
    const bool is_rim = i == 0 || i + 1 == chain.size();
    if (is_rim && !outer) continue;  // along the wall
    const Vec2 place = plan_.Metres(chain[i].x(), chain[i].y());
    if (!space_.IsFree(place, place, free_m)) continue;
    const double from = i == 0 ? first : AngleOf(chain[i - 1] - chain[i]);
    const double to = i + 1 == chain.size() ? first + free_angle : AngleOf(chain[i + 1] - chain[i]);
    corners_.push_back({chain[i], Wrapped(from), TurnTo(from, to)});
  }
}

std::vector<BlockedArc> LinkSpace::ViewFrom(const Vec2& place) const {
  if (touches_) return TouchingView(place, nullptr);
  std::vector<BlockedArc> arcs;
  for (const Segment& segment : segments_)
    AppendArcs(segment.start - place, segment.end - place, 0, 0, &arcs);
  return NearestArcs(std::move(arcs));
}

std::vector<BlockedArc> LinkSpace::ViewFrom(const Corner& corner) const {
  if (touches_) return TouchingView(corner.place, &corner);
  const std::vector<DirectionRange> ranges = LinkDirections(corner);
  // Most segments lie on one side of the lines that bound both ranges.
  const Vec2 first = Towards(ranges[0].from), last = Towards(ranges[0].from + ranges[0].width);
  const bool is_narrow = ranges[0].width < std::numbers::pi;
  std::vector<BlockedArc> arcs;
  for (const Segment& segment : segments_) {
    const Vec2 start = segment.start - corner.place, end = segment.end - corner.place;
    const double left =
        std::min({Cross(first, start), Cross(first, end), Cross(last, start), Cross(last, end)});
    const double right =
        std::max({Cross(first, start), Cross(first, end), Cross(last, start), Cross(last, end)});
    if (is_narrow && (left > 0 || right < 0)) continue;
    AppendArcs(start, end, 0, 0, &arcs);
  }
  KeepWithin(ranges, &arcs);
  return NearestArcs(std::move(arcs));
}

// Sides are decided in integers: a link may touch a vertex on the side on which no wall leaves it.
std::vector<BlockedArc> LinkSpace::TouchingView(const Vec2& place, const Corner* corner) const {
  const GridPoint origin{static_cast<int64_t>(place.x()), static_cast<int64_t>(place.y())};
  std::vector<unsigned> walls_on(plan_.vertices.size(), 0);  // sets of PassingSide
  std::vector<const PlanPiece*> edge_on;
  const auto side_of = [&](const PlanPiece& piece) {
    return Orientation(origin, plan_.vertices[piece.start], plan_.vertices[piece.end]);
  };
  for (const PlanPiece& piece : plan_.pieces) {
    const GridPoint &start = plan_.vertices[piece.start], &end = plan_.vertices[piece.end];
    if (start == origin || end == origin) continue;
    const int64_t side = side_of(piece);
    if (side == 0) {
      edge_on.push_back(&piece);
    } else {
      walls_on[piece.start] |= side > 0 ? kLeftSide : kRightSide;
      walls_on[piece.end] |= side > 0 ? kRightSide : kLeftSide;
    }
  }
  // Along a wall one stays on one side of it.
  for (bool changed = true; changed;) {
    changed = false;
    for (const PlanPiece* piece : edge_on) {
      const unsigned sides = walls_on[piece->start] | walls_on[piece->end];
      changed |= walls_on[piece->start] != sides || walls_on[piece->end] != sides;
      walls_on[piece->start] = walls_on[piece->end] = sides;
    }
  }
  std::vector<BlockedArc> arcs;
  for (const PlanPiece& piece : plan_.pieces) {
    const int64_t side = side_of(piece);
    if (side == 0) continue;
    const int32_t first = side > 0 ? piece.start : piece.end, last = side > 0 ? piece.end : piece.start;
    AppendArcs(Real(plan_.vertices[first]) - place, Real(plan_.vertices[last]) - place,
               (walls_on[first] & kRightSide) == 0 ? kSlack : 0,
               (walls_on[last] & kLeftSide) == 0 ? kSlack : 0, &arcs);
  }
  for (const Segment& segment : segments_)
    AppendArcs(segment.start - place, segment.end - place, 0, 0, &arcs);
  if (corner != nullptr) KeepWithin(LinkDirections(*corner), &arcs);
  return NearestArcs(std::move(arcs));
}

double LinkSpace::Reach(const Corner& corner, const std::vector<BlockedArc>& view, double angle) const {
  // Along the corner's own sides a link is no window, and rounding could take it inside.
  constexpr double kAlong = 1e-8;
  const double turn = TurnTo(corner.from, angle);
  if (turn < kAlong || turn > 2 * std::numbers::pi - kAlong || std::abs(turn - corner.free_angle) < kAlong)
    return 0;
  const auto arc = FirstArcFrom(view, angle);
  double reach = arc == view.end() || arc->from > angle ? 0 : arc->Distance(angle);
  if (!touches_) return reach;
  // A link that runs along a wall ends where the wall begins: from there on the wall's own ends see as far.
  const GridPoint origin{static_cast<int64_t>(corner.place.x()), static_cast<int64_t>(corner.place.y())};
  const Vec2 direction = Towards(angle);
  for (const PlanPiece& piece : plan_.pieces) {
    const GridPoint &start = plan_.vertices[piece.start], &end = plan_.vertices[piece.end];
    if (Orientation(origin, start, end) != 0) continue;
    const Vec2 to_start = Real(start) - corner.place, to_end = Real(end) - corner.place;
    const Vec2& farther = to_start.squaredNorm() > to_end.squaredNorm() ? to_start : to_end;
    if (direction.dot(farther) <= 0 || std::abs(Cross(direction, farther)) > 4 * kSlack * farther.norm())
      continue;
    reach = std::min({reach, to_start.norm(), to_end.norm()});
  }
  return reach;
}

}  // namespace cairn
