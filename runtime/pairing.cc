#include "runtime/pairing.h"

#include <algorithm>
#include <cmath>

#include "core/vector_geometry.h"

namespace cairn {

using Vec2 = Eigen::Vector2d;

Pairing MakePairing(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                    double length_tolerance_m) {
  Pairing pairing;
  const Vec2 start = LabelStart(plan, label), along = LabelEnd(plan, label) - start;
  const double spare = along.norm() - segment.Length();
  pairing.possible = spare >= -length_tolerance_m;
  pairing.heading = std::atan2(along.y(), along.x()) - segment.Angle();
  pairing.from = start - Eigen::Rotation2Dd(pairing.heading) * segment.start;
  if (spare < 0) pairing.from += 0.5 * spare * along.normalized();
  pairing.to = pairing.from + std::max(0.0, spare) * along.normalized();
  return pairing;
}

double PointToLine(const Vec2& point, const Vec2& from, const Vec2& to) {
  const Vec2 along = to - from;
  const double squared = along.squaredNorm();
  const double share = squared > 0 ? std::clamp((point - from).dot(along) / squared, 0.0, 1.0) : 0;
  return (point - from - share * along).norm();
}

double LineToLine(const Pairing& a, const Pairing& b) {
  const Vec2 u = a.to - a.from, v = b.to - b.from;
  const double denominator = Cross(u, v);
  if (denominator != 0) {
    const double s = Cross(b.from - a.from, v) / denominator, t = Cross(b.from - a.from, u) / denominator;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return 0;
  }
  return std::min({PointToLine(a.from, b.from, b.to), PointToLine(a.to, b.from, b.to),
                   PointToLine(b.from, a.from, a.to), PointToLine(b.to, a.from, a.to)});
}

bool Touches(const Eigen::AlignedBox2f& box, const Pairing& pairing, double reach) {
  double first = 0, last = 1;
  const Vec2 along = pairing.to - pairing.from;
  for (int axis = 0; axis < 2; ++axis) {
    const double low = box.min()[axis] - reach - pairing.from[axis],
                 high = box.max()[axis] + reach - pairing.from[axis];
    if (std::abs(along[axis]) < 1e-12) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    const double a = low / along[axis], b = high / along[axis];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  return first <= last;
}

}  // namespace cairn
