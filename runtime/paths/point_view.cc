#include "runtime/paths/point_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
using Arcs = std::vector<BlockedArc>;

// An arc without length, and one that continues the one before it, are not kept apart.
void Append(const BlockedArc& arc, double from, double to, Arcs* arcs) {
  if (!(to > from)) return;
  if (!arcs->empty() && arcs->back().to == from && arcs->back().start == arc.start &&
      arcs->back().end == arc.end) {
    arcs->back().to = to;
    return;
  }
  arcs->push_back({from, to, arc.start, arc.end});
}

// Where both are: the nearer one; they change where their segments cross.
void AppendNearer(const BlockedArc& a, const BlockedArc& b, double from, double to, Arcs* arcs) {
  const double first = a.Distance(from) - b.Distance(from), last = a.Distance(to) - b.Distance(to);
  if ((first < 0 && last > 0) || (first > 0 && last < 0)) {
    const Vec2 u = a.end - a.start, v = b.end - b.start;
    const double turn = Cross(u, v);
    if (turn != 0) {
      const Vec2 crossing = a.start + Cross(b.start - a.start, v) / turn * u;
      const double angle = std::clamp(AngleOf(crossing), from, to);
      Append(first < 0 ? a : b, from, angle, arcs);
      Append(first < 0 ? b : a, angle, to, arcs);
      return;
    }
  }
  const double middle = 0.5 * (from + to);
  Append(a.Distance(middle) <= b.Distance(middle) ? a : b, from, to, arcs);
}

Arcs Merged(const Arcs& first, const Arcs& second) {
  constexpr double kEnd = std::numeric_limits<double>::infinity();
  Arcs merged;
  size_t i = 0, k = 0;
  double at = -kEnd;
  while (i < first.size() || k < second.size()) {
    const double from_a = i < first.size() ? std::max(at, first[i].from) : kEnd;
    const double from_b = k < second.size() ? std::max(at, second[k].from) : kEnd;
    if (from_a < from_b) {
      const double to = std::min(first[i].to, from_b);
      Append(first[i], from_a, to, &merged);
      at = to;
    } else if (from_b < from_a) {
      const double to = std::min(second[k].to, from_a);
      Append(second[k], from_b, to, &merged);
      at = to;
    } else {
      const double to = std::min(first[i].to, second[k].to);
      AppendNearer(first[i], second[k], from_a, to, &merged);
      at = to;
    }
    while (i < first.size() && first[i].to <= at) ++i;
    while (k < second.size() && second[k].to <= at) ++k;
  }
  return merged;
}

}  // namespace

double AngleOf(const Vec2& direction) { return std::atan2(direction.y(), direction.x()); }

double BlockedArc::Distance(double angle) const {
  const Vec2 along = end - start;
  return Cross(start, along) / Cross(Vec2(std::cos(angle), std::sin(angle)), along);
}

void AppendArcs(const Vec2& start, const Vec2& end, double spare_start, double spare_end, Arcs* arcs) {
  const double side = Cross(start, end);
  if (side == 0) return;
  const Vec2 &first = side > 0 ? start : end, &last = side > 0 ? end : start;
  double from = AngleOf(first);
  double width = AngleOf(last) - from;
  if (width < 0) width += 2 * std::numbers::pi;
  from += spare_start;
  width -= spare_start + spare_end;
  if (!(width > 0)) return;
  if (from >= std::numbers::pi) from -= 2 * std::numbers::pi;
  // To the last digit the angle of the end: segments that share it leave no gap.
  const double to = spare_end == 0 ? AngleOf(last) : from + width;
  if (to >= from && to <= std::numbers::pi) {
    arcs->push_back({from, to, first, last});
  } else {
    arcs->push_back({from, std::numbers::pi, first, last});
    arcs->push_back({-std::numbers::pi, to > std::numbers::pi ? to - 2 * std::numbers::pi : to, first, last});
  }
}

Arcs NearestArcs(Arcs arcs) {
  if (arcs.empty()) return {};
  std::vector<Arcs> parts;
  parts.reserve(arcs.size());
  for (const BlockedArc& arc : arcs) parts.push_back({arc});
  for (; parts.size() > 1; parts.resize((parts.size() + 1) / 2)) {
    for (size_t i = 0; 2 * i < parts.size(); ++i) {
      parts[i] = 2 * i + 1 < parts.size() ? Merged(parts[2 * i], parts[2 * i + 1]) : std::move(parts[2 * i]);
    }
  }
  return std::move(parts[0]);
}

Arcs::const_iterator FirstArcFrom(const Arcs& view, double angle) {
  return std::partition_point(view.begin(), view.end(),
                              [angle](const BlockedArc& arc) { return arc.to < angle; });
}

}  // namespace cairn
