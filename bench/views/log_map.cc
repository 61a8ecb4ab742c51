#include "bench/views/log_map.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/pose.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;

// One wall of the map: points of all segments that lie on it, as a line with an extent.
struct MapWall {
  Vec2 centre, along;
  double low, high, weight;
  int num_scans;
};

// Joins a segment to the wall that it continues or repeats, walls seen from one side only being one-sided.
void AddSegment(const Vec2& start, const Vec2& end, std::vector<MapWall>* walls) {
  const Vec2 along = (end - start).normalized(), middle = 0.5 * (start + end);
  const double length = (end - start).norm();
  for (MapWall& wall : *walls) {
    if (wall.along.dot(along) < std::cos(RadFromDeg(6))) continue;
    const Vec2 normal(-wall.along.y(), wall.along.x());
    const double a = wall.along.dot(start - wall.centre), b = wall.along.dot(end - wall.centre);
    if (std::max(std::abs(normal.dot(start - wall.centre)), std::abs(normal.dot(end - wall.centre))) > 0.12)
      continue;
    if (b < wall.low - 0.3 || a > wall.high + 0.3) continue;
    const double weight = wall.weight + length;
    const double share = length / weight;
    // The line moves towards the segment, by its share.
    const Vec2 low = wall.centre + wall.low * wall.along, high = wall.centre + wall.high * wall.along;
    wall.centre += share * normal.dot(middle - wall.centre) * normal;
    wall.along = (wall.along + share * (along - wall.along)).normalized();
    wall.low = std::min(wall.along.dot(low - wall.centre), wall.along.dot(start - wall.centre));
    wall.high = std::max(wall.along.dot(high - wall.centre), wall.along.dot(end - wall.centre));
    wall.weight = weight;
    ++wall.num_scans;
    return;
  }
  walls->push_back({middle, along, -0.5 * length, 0.5 * length, length, 1});
}

}  // namespace

decompose_views::InputPlan MapOfEverySecond(const std::vector<RangeScan>& scans,
                                            const ScanSegmentsOptions& options) {
  std::vector<MapWall> walls;
  for (size_t i = 0; i < scans.size(); i += 2) {
    for (const ScanSegment& segment : FindScanSegments(scans[i], options))
      AddSegment(scans[i].pose.FloorFromRobot(segment.start), scans[i].pose.FloorFromRobot(segment.end),
                 &walls);
  }
  decompose_views::InputPlan input;
  for (const MapWall& wall : walls) {
    if (wall.num_scans < 3 || wall.high - wall.low < 0.4) continue;
    input.segments.push_back({wall.centre + wall.low * wall.along, wall.centre + wall.high * wall.along,
                              static_cast<int>(input.segments.size()) + 1});
  }
  return input;
}

}  // namespace cairn
