#include "runtime/paths/plan_roadmap.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

#include "core/geometry/vector_geometry.h"
#include "runtime/paths/point_view.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
constexpr double kPi = std::numbers::pi;
// Greatest angle between neighbours of the points around a corner.
constexpr double kTurnStep = kPi / 8;
// Extra distance from walls beyond the radius, metres, so that links that are computed as free stay free when
// checked again.
constexpr double kRounding = 1e-9;

Vec2 Direction(double angle) { return {std::cos(angle), std::sin(angle)}; }

}  // namespace

PlanRoadmap::PlanRoadmap(const PlanSpace& space, double radius_m, const std::vector<Vec2>& places)
    : space_(space), radius_m_(radius_m) {
  for (const Vec2& place : places) nodes_.push_back({place, space.IsFree(place, place, radius_m)});
  AddCorners();
}

void PlanRoadmap::AddCorners() {
  const std::vector<WallCorner>& corners = space_.corners();
  for (int32_t i = 0; i < static_cast<int32_t>(corners.size()); ++i) {
    const Vec2 vertex = space_.views().plan.Metres(corners[i].vertex);
    if (radius_m_ <= 0) {
      nodes_.push_back({vertex, true, i});
      continue;
    }
    // From the normal of the first wall to that of the last.
    const double first = AngleOf(Real(corners[i].first) - Real(corners[i].vertex));
    double free_angle = AngleOf(Real(corners[i].last) - Real(corners[i].vertex)) - first;
    if (free_angle <= 0) free_angle += 2 * kPi;
    const int num_points = std::max(1, static_cast<int>(std::ceil((free_angle - kPi) / kTurnStep)));
    const double half_step = 0.5 * (free_angle - kPi) / num_points;
    const double rim_m = radius_m_ + kRounding;
    for (int k = 0; k < num_points; ++k) {
      const double angle = first + 0.5 * kPi + (2 * k + 1) * half_step;
      const Vec2 place = vertex + rim_m / std::cos(half_step) * Direction(angle);
      if (!space_.IsFree(place, place, radius_m_)) continue;
      nodes_.push_back({place, true, i, vertex + rim_m * Direction(angle - half_step),
                        vertex + rim_m * Direction(angle + half_step)});
    }
  }
}

// Whether a straight link through a point of a corner's polygon leaves the polygon on one side: a shortest
// way has only such links, and most links are not.
bool PlanRoadmap::FollowsRim(const Node& node, const Vec2& direction) const {
  const double before = Cross(direction, node.rim_before - node.place);
  const double after = Cross(direction, node.rim_after - node.place);
  const double rounding = 1e-6 * direction.norm() * (node.rim_after - node.place).norm();
  return std::max(before, after) < rounding || std::min(before, after) > -rounding;
}

// On which sides of the walls of a node's corner a link may leave towards a place, or arrive from it.
unsigned PlanRoadmap::SidesAt(const Node& node, const Vec2& towards, bool leaves) const {
  if (node.corner < 0) return kEitherSide;
  const WallCorner& corner = space_.corners()[node.corner];
  const FloorPlan& plan = space_.views().plan;
  const Vec2 rounded = plan.Grid(towards).array().round();
  const GridPoint to{static_cast<int64_t>(rounded.x()), static_cast<int64_t>(rounded.y())};
  const int64_t from_last = Orientation(corner.vertex, corner.last, to);
  const int64_t from_first = Orientation(corner.vertex, corner.first, to);
  // Between `last` and `first`, counter-clockwise, are the walls: less than 180 degrees.
  const auto is_along = [&](const GridPoint& end) {
    return (end.x - corner.vertex.x) * (to.x - corner.vertex.x) +
               (end.y - corner.vertex.y) * (to.y - corner.vertex.y) >
           0;
  };
  unsigned sides = 0;  // seen from the corner
  if (from_first == 0 && is_along(corner.first)) sides |= kLeftSide;
  if (from_last == 0 && is_along(corner.last)) sides |= kRightSide;
  if (sides == 0) {
    const bool is_single = corner.first == corner.last;
    if (!is_single && from_last > 0 && from_first < 0) return 0;
    return kEitherSide;
  }
  if (!leaves && sides != kEitherSide) sides ^= kEitherSide;
  return sides;
}

std::vector<Vec2> PlanRoadmap::Places(const std::vector<int>& nodes) const {
  std::vector<Vec2> places;
  for (const int node : nodes) places.push_back(place(node));
  return places;
}

bool PlanRoadmap::AreJoined(int a, int b) const {
  const Node &from = nodes_[a], &to = nodes_[b];
  if (!from.fits || !to.fits) return false;
  if (radius_m_ > 0) {
    const Vec2 direction = to.place - from.place;
    if (from.corner >= 0 && !FollowsRim(from, direction)) return false;
    if (to.corner >= 0 && !FollowsRim(to, direction)) return false;
    return space_.IsFree(from.place, to.place, radius_m_);
  }
  const unsigned leaving = SidesAt(from, to.place, /*leaves=*/true);
  const unsigned arriving = SidesAt(to, from.place, /*leaves=*/false);
  return leaving != 0 && arriving != 0 &&
         space_.PassageBetween(from.place, to.place).Joins(leaving, arriving);
}

std::vector<int> PlanRoadmap::ShortestWay(int from, int to) const {
  std::vector<double> lengths(nodes_.size(), std::numeric_limits<double>::infinity());
  std::vector<int> before(nodes_.size(), -1);
  std::vector<bool> done(nodes_.size(), false);
  const auto rest = [&](int node) { return (place(to) - place(node)).norm(); };
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  lengths[from] = 0;
  queue.push({rest(from), from});
  while (!queue.empty() && !done[to]) {
    const int at = queue.top().second;
    queue.pop();
    if (done[at]) continue;
    done[at] = true;
    for (int next = 0; next < num_nodes(); ++next) {
      const double length = lengths[at] + (place(next) - place(at)).norm();
      if (done[next] || length >= lengths[next] || length + rest(next) >= lengths[to]) continue;
      if (!AreJoined(at, next)) continue;
      lengths[next] = length;
      before[next] = at;
      queue.push({length + rest(next), next});
    }
  }
  if (!done[to]) return {};
  std::vector<int> way;
  for (int at = to; at >= 0; at = before[at]) way.push_back(at);
  std::reverse(way.begin(), way.end());
  return Tightened(way, [&](int a, int b) { return AreJoined(a, b); });
}

}  // namespace cairn
