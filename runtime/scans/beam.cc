#include "runtime/scans/beam.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

constexpr double kStepRad = std::numbers::pi / 180;
constexpr int kLeastInSegment = 5;

}  // namespace

std::vector<Beam> BeamsOf(const RangeScan& scan, double max_range_m) {
  std::vector<Beam> beams;
  const double largest = std::min(max_range_m, scan.max_range_m);
  beams.reserve(scan.ranges_m.size());
  for (size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const double range = scan.ranges_m[i];
    if (!(range > 0)) continue;
    const double angle = scan.AngleOf(i);
    beams.push_back({{std::cos(angle), std::sin(angle)}, std::min(range, largest), range < largest});
  }
  return beams;
}

std::vector<Beam> BeamsTo(const std::vector<ScanSegment>& segments) {
  std::vector<Beam> beams;
  for (const ScanSegment& segment : segments) {
    const double turn = std::atan2(Cross(segment.start, segment.end), segment.start.dot(segment.end));
    const int num = std::max(kLeastInSegment, static_cast<int>(std::abs(turn) / kStepRad));
    // In equal steps of the direction, as a laser has them.
    const Eigen::Vector2d along = segment.end - segment.start;
    const double farthest = (1 + 1e-9) * std::max(segment.start.norm(), segment.end.norm());
    const double nearest = (1 - 1e-9) * std::abs(Cross(segment.start, along)) / along.norm();
    for (int i = 0; i < num; ++i) {
      const Eigen::Rotation2Dd rotation((i + 0.5) / num * turn);
      const Eigen::Vector2d direction = (rotation * segment.start).normalized();
      const double range = Cross(segment.start, along) / Cross(direction, along);
      // Seen along the line itself, a segment has no such point.
      if (range >= nearest && range <= farthest) beams.push_back({direction, range, true});
    }
  }
  return beams;
}

}  // namespace cairn
