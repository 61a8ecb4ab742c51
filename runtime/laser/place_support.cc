#include "runtime/laser/place_support.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

struct Interval {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  bool empty() const { return low > high; }
  // Clips to those s with least <= start + s * slope <= most.
  void Clip(double start, double slope, double least, double most) {
    if (std::abs(slope) < 1e-12) {
      if (start < least || start > most) high = -std::numeric_limits<double>::infinity();
      return;
    }
    const double a = (least - start) / slope, b = (most - start) / slope;
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  }
};

// Where the line `from + s * along` (|along| = 1) is within `reach` of the line between `a` and `b`: a convex
// set, so one interval.
std::optional<Interval> Within(const Vec2& from, const Vec2& along, const Vec2& a, const Vec2& b,
                               double reach) {
  Interval hull{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto join = [&](const Interval& part) {
    if (part.empty()) return;
    hull.low = std::min(hull.low, part.low);
    hull.high = std::max(hull.high, part.high);
  };
  for (const Vec2& end : {a, b}) {
    const double nearest = along.dot(end - from);
    const double squared = reach * reach - (from + nearest * along - end).squaredNorm();
    if (squared >= 0) join({nearest - std::sqrt(squared), nearest + std::sqrt(squared)});
  }
  const double length = (b - a).norm();
  if (length > 1e-12) {
    const Vec2 x = (b - a) / length, y(-x.y(), x.x());
    Interval beside;
    beside.Clip(x.dot(from - a), x.dot(along), 0, length);
    beside.Clip(y.dot(from - a), y.dot(along), -reach, reach);
    join(beside);
  }
  if (hull.empty()) return std::nullopt;
  return hull;
}

}  // namespace

std::vector<PlaceStretch> StretchesAlong(const PairingTable& table, int segment, LabelIdx label,
                                         const std::vector<int>& others,
                                         const std::function<bool(LabelIdx)>& may_be) {
  const Pairing& first = table.Of(segment, label);
  const double length = (first.to - first.from).norm();
  std::vector<PlaceStretch> stretches;
  std::vector<LabelIdx> labels;
  for (const int other : others) {
    const double reach = table.LoosePlaceTolerance(segment, other);
    const double beyond = table.EndTolerance(segment) + reach;
    labels.clear();
    table.LabelsWithHeading(other, first.heading, table.AngleTolerance(segment, other), &labels);
    for (const LabelIdx further : labels) {
      if (!may_be(further)) continue;
      const Pairing& pairing = table.Of(other, further);
      const Vec2 more = table.EndTolerance(other) * table.Along(further);
      const auto part = Within(first.from, table.Along(label), pairing.from - more, pairing.to + more, reach);
      if (!part) continue;
      const double low = std::max(part->low, -beyond), high = std::min(part->high, length + beyond);
      if (low <= high) stretches.push_back({low, high, other, further});
    }
  }
  return stretches;
}

std::vector<SupportedPlaces> PlacesWithSupport(const std::vector<PlaceStretch>& stretches, int least) {
  struct Event {
    double at;
    int change;
    // Stretches are closed: those that begin somewhere come before those that end there.
    bool operator<(const Event& other) const {
      return at != other.at ? at < other.at : change > other.change;
    }
  };
  std::vector<Event> events;
  std::vector<Interval> own;
  for (size_t first = 0; first < stretches.size();) {
    own.clear();
    size_t last = first;
    for (; last < stretches.size() && stretches[last].segment == stretches[first].segment; ++last)
      own.push_back({stretches[last].low, stretches[last].high});
    std::sort(own.begin(), own.end(), [](const Interval& a, const Interval& b) { return a.low < b.low; });
    for (size_t i = 0; i < own.size();) {
      Interval joined = own[i];
      for (++i; i < own.size() && own[i].low <= joined.high; ++i)
        joined.high = std::max(joined.high, own[i].high);
      events.push_back({joined.low, 1});
      events.push_back({joined.high, -1});
    }
    first = last;
  }
  std::sort(events.begin(), events.end());
  std::vector<SupportedPlaces> places;
  int num = 0;
  for (size_t i = 0; i < events.size(); ++i) {
    num += events[i].change;
    const bool at_a_point = i + 1 < events.size() && events[i + 1].at == events[i].at;
    // A point counts after all stretches that begin there and before any that ends there.
    if (i + 1 == events.size() || (at_a_point && !(events[i].change > 0 && events[i + 1].change < 0)))
      continue;
    if (num >= least) places.push_back({events[i].at, events[i + 1].at, num});
  }
  return places;
}

std::vector<SupportedPlaces> BestSupported(const std::vector<SupportedPlaces>& places) {
  std::vector<SupportedPlaces> best;
  for (size_t i = 0; i < places.size(); ++i) {
    const bool left =
        i > 0 && places[i - 1].high >= places[i].low && places[i - 1].num_segments > places[i].num_segments;
    const bool right = i + 1 < places.size() && places[i + 1].low <= places[i].high &&
                       places[i + 1].num_segments > places[i].num_segments;
    if (!left && !right) best.push_back(places[i]);
  }
  return best;
}

std::vector<PlaceStretch> StretchesOver(const std::vector<PlaceStretch>& stretches, double place) {
  const auto from_middle = [&](const PlaceStretch& of) { return std::abs(0.5 * (of.low + of.high) - place); };
  std::vector<PlaceStretch> over;
  for (const PlaceStretch& stretch : stretches) {
    if (stretch.low > place || stretch.high < place) continue;
    if (over.empty() || over.back().segment != stretch.segment) {
      over.push_back(stretch);
    } else if (from_middle(stretch) < from_middle(over.back())) {
      over.back() = stretch;
    }
  }
  return over;
}

}  // namespace cairn
