#include "runtime/laser/pairing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/geometry/pose.h"
#include "core/geometry/vector_geometry.h"

namespace cairn {

using Vec2 = Eigen::Vector2d;

Pairing MakePairing(const FloorPlan& plan, const ScanSegment& segment, LabelIdx label,
                    double length_tolerance_m) {
  Pairing pairing;
  const Vec2 start = LabelStart(plan, label), along = LabelEnd(plan, label) - start;
  // [Simsarian96 §2.3] a segment is a portion of its edge
  const double spare = along.norm() - segment.Length();
  pairing.possible = spare >= -length_tolerance_m;
  pairing.heading = std::atan2(along.y(), along.x()) - segment.Angle();
  pairing.from = start - Eigen::Rotation2Dd(pairing.heading) * segment.start;
  if (spare < 0) pairing.from += 0.5 * spare * along.normalized();
  pairing.to = pairing.from + std::max(0.0, spare) * along.normalized();
  return pairing;
}

double LineToLine(const Pairing& a, const Pairing& b) {
  const Vec2 u = a.to - a.from, v = b.to - b.from;
  const double denominator = Cross(u, v);
  if (denominator != 0) {
    const double s = Cross(b.from - a.from, v) / denominator, t = Cross(b.from - a.from, u) / denominator;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return 0;
  }
  return std::min({PointToSegment(a.from, b.from, b.to), PointToSegment(a.to, b.from, b.to),
                   PointToSegment(b.from, a.from, a.to), PointToSegment(b.to, a.from, a.to)});
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

int MaxNumNulls(size_t num_segments, const InterpretationTreeOptions& options) {
  return static_cast<int>(std::floor(options.max_null_ratio * static_cast<double>(num_segments)));
}

PairingTable::PairingTable(const FloorPlan& plan, const std::vector<ScanSegment>& segments,
                           const InterpretationTreeOptions& options)
    : plan_(plan), segments_(segments), options_(options) {
  for (LabelIdx label = 0; label < plan.num_labels(); ++label) {
    along_.push_back((LabelEnd(plan, label) - LabelStart(plan, label)).normalized());
    by_angle_.emplace_back(std::atan2(along_.back().y(), along_.back().x()), label);
  }
  std::sort(by_angle_.begin(), by_angle_.end());
  pairings_.reserve(segments.size() * plan.num_labels());
  for (const ScanSegment& segment : segments) {
    for (LabelIdx label = 0; label < plan.num_labels(); ++label)
      pairings_.push_back(MakePairing(plan, segment, label, options.length_tolerance_m));
    angle_tolerance_.push_back(options.num_sigmas * segment.sigma_angle_rad);
    // An angle moves the line of places by the distance along the wall, and its ends by that across.
    const Vec2 along = (segment.end - segment.start).normalized();
    const double lever = std::abs(along.dot(segment.Middle())),
                 across = std::abs(Cross(along, segment.Middle()));
    const double offset = std::hypot(segment.sigma_offset_m, lever * segment.sigma_angle_rad);
    place_tolerance_.push_back(options.num_sigmas * offset);
    const double wall_angle = RadFromDeg(options.sigma_wall_deg);
    loose_place_tolerance_.push_back(options.num_sigmas *
                                     std::hypot(offset, options.sigma_wall_m, lever * wall_angle));
    end_tolerance_.push_back(options.num_sigmas * across * std::hypot(segment.sigma_angle_rad, wall_angle));
  }
}

double PairingTable::AngleTolerance(int a, int b) const {
  return std::hypot(angle_tolerance_[a], angle_tolerance_[b]) + RadFromDeg(options_.angle_tolerance_deg);
}

double PairingTable::LoosePlaceTolerance(int a, int b) const {
  return loose_place_tolerance_[a] + loose_place_tolerance_[b] + 2 * options_.position_tolerance_m;
}

bool PairingTable::Agree(int a, LabelIdx label_a, int b, LabelIdx label_b) const {
  const Pairing &pa = Of(a, label_a), &pb = Of(b, label_b);
  // [Simsarian96 §2.3: after Gaston and Lozano-Perez] two pairings that geometry excludes prune the branch
  if (std::abs(WrapAngle(pa.heading - pb.heading)) > AngleTolerance(a, b)) return false;
  const double place = std::hypot(place_tolerance_[a], place_tolerance_[b]) + options_.position_tolerance_m;
  return LineToLine(pa, pb) <= place;
}

void PairingTable::LabelsWithHeading(int segment, double heading, double tolerance_rad,
                                     std::vector<LabelIdx>* labels) const {
  const auto append = [&](double low, double high) {
    for (auto at = std::lower_bound(by_angle_.begin(), by_angle_.end(), std::pair{low, LabelIdx{-1}});
         at != by_angle_.end() && at->first <= high; ++at) {
      if (Of(segment, at->second).possible) labels->push_back(at->second);
    }
  };
  constexpr double kPi = std::numbers::pi;
  if (tolerance_rad >= kPi) return append(-kPi, kPi);
  const double angle = WrapAngle(heading + segments_[segment].Angle());
  append(angle - tolerance_rad, angle + tolerance_rad);
  if (angle - tolerance_rad < -kPi) append(angle - tolerance_rad + 2 * kPi, kPi);
  if (angle + tolerance_rad > kPi) append(-kPi, angle + tolerance_rad - 2 * kPi);
}

}  // namespace cairn
