#include "runtime/paths/fewest_links.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
using View = std::vector<BlockedArc>;

// A free segment, all of which as many links reach.
struct LinkWindow {
  Vec2 start, end;
  int before = -1;            // the window that it was seen from, -1: it is the start
  Vec2 joint = Vec2::Zero();  // where its line meets that one
};

// Directions in which a window is seen.
struct SeenArc {
  double from = 0, to = 0;
  int window = 0;
};

double Wrap(double angle) {
  return angle > std::numbers::pi    ? angle - 2 * std::numbers::pi
         : angle < -std::numbers::pi ? angle + 2 * std::numbers::pi
                                     : angle;
}

// Where the ray from `place` in a direction meets a window; the nearer end where the window lies along it.
Vec2 MeetingPoint(const Vec2& place, double angle, const LinkWindow& window) {
  const Vec2 along = window.end - window.start, direction(std::cos(angle), std::sin(angle));
  const double turn = Cross(direction, along);
  if (std::abs(turn) <= 1e-12 * along.norm()) {
    return (window.start - place).squaredNorm() < (window.end - place).squaredNorm() ? window.start
                                                                                     : window.end;
  }
  const double share = std::clamp(Cross(window.start - place, direction) / turn, 0.0, 1.0);
  return window.start + share * along;
}

class LinkSearch {
 public:
  explicit LinkSearch(const LinkSpace& space)
      : space_(space),
        goal_view_(space.ViewFrom(space.to())),
        views_(space.corners().size()),
        reached_(space.corners().size(), false) {}

  LinkedPath Run() {
    // [Simsarian96 §4.1] The fewest links, by weak visibility regions: of these only the windows.
    windows_.push_back({space_.from(), space_.from()});
    int first = 0;
    for (int num_links = 1;; ++num_links) {
      const int last = static_cast<int>(windows_.size());
      if (first == last) return {};
      std::vector<SeenArc> seen;
      for (int i = first; i < last; ++i) See(space_.to(), goal_view_, i, &seen);
      if (!seen.empty()) return {num_links, BestPath(seen)};
      for (size_t i = 0; i < space_.corners().size(); ++i) {
        if (!reached_[i]) Reach(i, first, last);
      }
      first = last;
    }
  }

 private:
  // Appends in which directions of a view a window is seen.
  void See(const Vec2& place, const View& view, int window, std::vector<SeenArc>* seen) const {
    const Vec2 start = windows_[window].start - place, end = windows_[window].end - place;
    const double slack = space_.slack();
    const double side = Cross(start, end), from_start = start.norm(), from_end = end.norm();
    const auto add = [&](double low, double high, const auto& distance_at) {
      for (auto arc = FirstArcFrom(view, low); arc != view.end() && arc->from <= high; ++arc) {
        const double left = std::max(low, arc->from), right = std::min(high, arc->to);
        const double middle = 0.5 * (left + right);
        if (distance_at(middle) <= arc->Distance(middle)) seen->push_back({left, right, window});
      }
    };
    const auto add_wrapped = [&](double from, double width, const auto& distance_at) {
      from = Wrap(from - slack);
      width += 2 * slack;
      add(from, std::min(std::numbers::pi, from + width), distance_at);
      if (from + width > std::numbers::pi)
        add(-std::numbers::pi, from + width - 2 * std::numbers::pi, distance_at);
    };
    if (std::abs(side) > 1e-9 * from_start * from_end) {
      const Vec2 &first = side > 0 ? start : end, &last = side > 0 ? end : start;
      const double from = AngleOf(first);
      double width = AngleOf(last) - from;
      if (width < 0) width += 2 * std::numbers::pi;
      const BlockedArc across{0, 0, first, last};
      add_wrapped(from, width, [&](double angle) { return across.Distance(angle); });
      return;
    }
    // In line with the place: one end hides the other, or the place lies between them, or is one of them.
    const bool is_between = start.dot(end) <= 0;
    const double nearest = is_between ? 0 : std::min(from_start, from_end);
    for (const Vec2& tip : {start, end}) {
      if (tip.norm() < 1e-6 * std::max(from_start, from_end)) continue;
      add_wrapped(AngleOf(tip), 0, [&](double) { return nearest; });
    }
  }

  // Lets a corner have its turn, if it sees one of the windows [first, last) where a link through it goes on.
  void Reach(size_t i, int first, int last) {
    const LinkSpace::Corner& corner = space_.corners()[i];
    if (!views_[i]) views_[i] = space_.ViewFrom(corner);
    std::vector<SeenArc> seen;
    for (int window = first; window < last; ++window) See(corner.place, *views_[i], window, &seen);
    for (const DirectionRange& range : LinkDirections(corner)) {
      if (AddWindows(corner, *views_[i], range, seen)) reached_[i] = true;
    }
    if (reached_[i]) views_[i].reset();
  }

  // The windows beyond a corner, of what it sees in a range of directions; whether that is anything.
  bool AddWindows(const LinkSpace::Corner& corner, const View& view, const DirectionRange& range,
                  const std::vector<SeenArc>& seen) {
    // By how far counter-clockwise from the beginning of the range.
    std::vector<SeenArc> within;
    for (const SeenArc& arc : seen) {
      const double width = arc.to - arc.from;
      double from = arc.from - range.from;
      for (; from < 0; from += 2 * std::numbers::pi) {
      }
      for (const double shifted : {from, from - 2 * std::numbers::pi}) {
        const double left = std::max(0.0, shifted), right = std::min(range.width, shifted + width);
        if (left <= right) within.push_back({left, right, arc.window});
      }
    }
    std::sort(within.begin(), within.end(), [](const SeenArc& a, const SeenArc& b) {
      return std::tie(a.from, a.to, a.window) < std::tie(b.from, b.to, b.window);
    });
    // Neighbouring arcs of a view end where the next begins, up to rounding.
    constexpr double kJoined = 1e-12;
    for (size_t i = 0; i < within.size();) {
      size_t last = i, next = i + 1;
      for (; next < within.size() && within[next].from <= within[last].to + kJoined; ++next) {
        if (within[next].to > within[last].to) last = next;
      }
      AddWindow(corner, view, Wrap(range.from + within[i].from), within[i].window);
      if (within[last].to > within[i].from)
        AddWindow(corner, view, Wrap(range.from + within[last].to), within[last].window);
      i = next;
    }
    return !within.empty();
  }

  void AddWindow(const LinkSpace::Corner& corner, const View& view, double angle, int seen_window) {
    const double away = Wrap(angle + std::numbers::pi);
    const double reach = space_.Reach(corner, view, away);
    if (!(reach > 0)) return;
    windows_.push_back({corner.place, corner.place + reach * Vec2(std::cos(away), std::sin(away)),
                        seen_window, MeetingPoint(corner.place, angle, windows_[seen_window])});
  }

  std::vector<Vec2> PathThrough(int window, const Vec2& joint) const {
    std::vector<Vec2> points{space_.to()};
    Vec2 at = joint;
    for (int i = window; i >= 0; i = windows_[i].before) {
      points.push_back(at);
      at = windows_[i].joint;
    }
    std::reverse(points.begin(), points.end());
    return points;
  }

  // The shortest of those with the last joint at an end, or in the middle, of what the goal sees of a window.
  std::vector<Vec2> BestPath(const std::vector<SeenArc>& seen) const {
    std::vector<Vec2> best;
    double shortest = std::numeric_limits<double>::infinity();
    for (const SeenArc& arc : seen) {
      for (const double share : {0.5, 0.05, 0.95}) {
        const double angle = arc.from + share * (arc.to - arc.from);
        std::vector<Vec2> points =
            PathThrough(arc.window, MeetingPoint(space_.to(), angle, windows_[arc.window]));
        double length = 0;
        for (size_t i = 0; i + 1 < points.size(); ++i) length += (points[i + 1] - points[i]).norm();
        if (length >= shortest) continue;
        shortest = length;
        best = std::move(points);
      }
    }
    return best;
  }

  const LinkSpace& space_;
  const View goal_view_;
  std::vector<std::optional<View>> views_;
  std::vector<bool> reached_;
  std::vector<LinkWindow> windows_;
};

}  // namespace

LinkedPath FindFewestLinks(const LinkSpace& space) { return LinkSearch(space).Run(); }

}  // namespace cairn
