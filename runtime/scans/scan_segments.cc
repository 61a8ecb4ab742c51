#include "runtime/scans/scan_segments.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "core/geometry/planar_pose.h"
#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

using Vec2 = Eigen::Vector2d;
using Points = std::vector<Vec2>;

// Runs of beams whose points may belong to one surface.
std::vector<Points> Runs(const RangeScan& scan, const ScanSegmentsOptions& options) {
  std::vector<Points> runs;
  const double max_range = std::min(options.max_range_m, scan.max_range_m);
  bool open = false;
  double last_range = 0, last_angle = 0;
  for (size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const double range = scan.ranges_m[i];
    if (!(range > 0 && range < max_range)) {
      open = false;
      continue;
    }
    const double angle = scan.AngleOf(i);
    const double step = std::abs(scan.angles_rad.empty() ? scan.step_rad : WrapAngle(angle - last_angle));
    const Vec2 point = range * Vec2(std::cos(angle), std::sin(angle));
    // A wall seen at 10 degrees has its points this much farther apart than its range times the step.
    constexpr double kGrazing = 5.8;
    const double allowed = std::max(options.max_gap_m, kGrazing * std::min(range, last_range) * step);
    if (!open || (point - runs.back().back()).norm() > allowed) runs.emplace_back();
    runs.back().push_back(point);
    open = true;
    last_range = range;
    last_angle = angle;
  }
  return runs;
}

// The point of [first, last] farthest from the line through its ends.
size_t Farthest(const Points& points, size_t first, size_t last, double* distance) {
  const Vec2 along = points[last] - points[first];
  const double length = along.norm();
  size_t farthest = first;
  *distance = 0;
  for (size_t i = first + 1; i < last; ++i) {
    const Vec2 offset = points[i] - points[first];
    const double d = length > 1e-9 ? std::abs(Cross(along, offset)) / length : offset.norm();
    if (d > *distance) {
      *distance = d;
      farthest = i;
    }
  }
  return farthest;
}

void Split(const Points& points, size_t first, size_t last, double split_m,
           std::vector<std::pair<size_t, size_t>>* parts) {
  double distance = 0;
  const size_t farthest = Farthest(points, first, last, &distance);
  if (distance <= split_m || last - first < 2) {
    parts->push_back({first, last});
    return;
  }
  Split(points, first, farthest, split_m, parts);
  Split(points, farthest, last, split_m, parts);
}

// Largest distance of points from their fitted line.
double WorstResidual(const Points& points, const ScanSegment& line) {
  const Vec2 along = (line.end - line.start).normalized();
  double worst = 0;
  for (const Vec2& point : points) worst = std::max(worst, std::abs(Cross(along, point - line.start)));
  return worst;
}

}  // namespace

OptionTable DescribeOptions(ScanSegmentsOptions* o) {
  return {
      {.name = "max_range_m",
       .value = &o->max_range_m,
       .help = "beams of this range or more met nothing, metres",
       .min = 0.01,
       .max = 1e4},
      {.name = "sigma_range_m",
       .value = &o->sigma_range_m,
       .help = "least standard deviation of a range, metres",
       .min = 1e-6,
       .max = 10},
      {.name = "split_m",
       .value = &o->split_m,
       .help = "a point farther than this from its stretch's line divides it, metres",
       .min = 1e-6,
       .max = 10},
      {.name = "max_gap_m",
       .value = &o->max_gap_m,
       .help =
           "points farther apart than this are not on one wall (unless it is seen at a low angle), metres",
       .min = 1e-3,
       .max = 100},
      {.name = "min_num_points",
       .value = &o->min_num_points,
       .help = "least number of points of a segment",
       .min = 2,
       .max = 1e5},
      {.name = "min_length_m",
       .value = &o->min_length_m,
       .help = "least length of a segment, metres",
       .min = 0,
       .max = 100},
  };
}

ScanSegment FitSegment(const Points& points, double sigma_m) {
  const auto num = static_cast<double>(points.size());
  Vec2 mean = Vec2::Zero();
  for (const Vec2& point : points) mean += point / num;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Vec2& point : points) scatter += (point - mean) * (point - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(scatter);
  Vec2 along = solver.eigenvectors().col(1);
  if (along.dot(points.back() - points.front()) < 0) along = -along;
  double low = 0, high = 0;
  for (const Vec2& point : points) {
    low = std::min(low, along.dot(point - mean));
    high = std::max(high, along.dot(point - mean));
  }
  // The line is at least as uncertain as its residuals are large.
  const double residual =
      points.size() > 2 ? std::sqrt(std::max(0.0, solver.eigenvalues()[0]) / (num - 2)) : 0;
  const double sigma = std::max(sigma_m, residual);
  ScanSegment segment;
  segment.start = mean + low * along;
  segment.end = mean + high * along;
  segment.sigma_offset_m = sigma / std::sqrt(num);
  segment.sigma_angle_rad = sigma / std::sqrt(std::max(1e-12, solver.eigenvalues()[1]));
  segment.num_points = static_cast<int>(points.size());
  segment.sigma_end_m = sigma;
  return segment;
}

std::vector<ScanSegment> FindScanSegments(const RangeScan& scan, const ScanSegmentsOptions& options) {
  std::vector<ScanSegment> segments;
  for (const Points& run : Runs(scan, options)) {
    if (run.size() < 2) continue;
    std::vector<std::pair<size_t, size_t>> parts;
    Split(run, 0, run.size() - 1, options.split_m, &parts);
    // Merge neighbours that one line fits.  The point between two parts belongs to the first.
    std::vector<Points> stretches;
    for (const auto& [first, last] : parts) {
      Points points(run.begin() + static_cast<std::ptrdiff_t>(first + (first > 0 ? 1 : 0)),
                    run.begin() + static_cast<std::ptrdiff_t>(last + 1));
      if (!stretches.empty()) {
        Points both = stretches.back();
        both.insert(both.end(), points.begin(), points.end());
        if (WorstResidual(both, FitSegment(both, options.sigma_range_m)) <= 0.75 * options.split_m) {
          stretches.back() = std::move(both);
          continue;
        }
      }
      stretches.push_back(std::move(points));
    }
    for (Points& points : stretches) {
      if (static_cast<int>(points.size()) < std::max(2, options.min_num_points)) continue;
      // A laser that turns clockwise saw them the other way round.
      if (Cross(points[0], points[1]) < 0) std::reverse(points.begin(), points.end());
      const ScanSegment segment = FitSegment(points, options.sigma_range_m);
      // The robot cannot see a line through itself.
      if (segment.Length() < std::max(1e-6, options.min_length_m) || Cross(segment.start, segment.end) <= 0)
        continue;
      segments.push_back(segment);
    }
  }
  return segments;
}

}  // namespace cairn
