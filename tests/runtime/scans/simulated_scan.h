#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/planar_pose.h"
#include "core/plan/views.h"
#include "core/plan/visible_walls.h"
#include "runtime/scans/scan_segments.h"

namespace cairn {

struct SimulatedScanOptions {
  double sigma_m = 0;         // of the points of a segment
  double missing_ratio = 0;   // of the visible walls
  double spurious_ratio = 0;  // segments of no wall, of those that are left
  double min_length_m = 0;    // walls of which less is visible are not seen
};

// A random place with its heading, at least `clearance_m` from walls, in a region; none after many tries.
inline std::optional<PlanarPose> RandomPose(const Views& views, const FaceLocator& locator,
                                            double clearance_m, Random* random) {
  const Eigen::Vector2d low = views.plan.Metres(views.plan.low), high = views.plan.Metres(views.plan.high);
  for (int tries = 0; tries < 100000; ++tries) {
    const Eigen::Vector2d place(random->Uniform(low.x(), high.x()), random->Uniform(low.y(), high.y()));
    const double heading = random->Uniform(-std::numbers::pi, std::numbers::pi);
    if (locator.Find(place) < 0) continue;
    bool clear = true;
    for (const PlanWall& wall : views.plan.walls) {
      const Eigen::Vector2d along = wall.end - wall.start;
      const double share = std::clamp((place - wall.start).dot(along) / along.squaredNorm(), 0.0, 1.0);
      clear = clear && (place - wall.start - share * along).norm() >= clearance_m;
    }
    if (clear) return PlanarPose{place, heading};
  }
  return std::nullopt;
}

// Of every visible wall a random portion, at least half of its longest visible stretch [Simsarian96 §3].
inline std::vector<ScanSegment> SimulateScan(const Views& views, FaceIdx face, const PlanarPose& pose,
                                             const SimulatedScanOptions& options, Random* random) {
  std::vector<VisibleStretch> longest;
  for (const VisibleStretch& stretch : VisibleStretches(views.plan, views.LabelSet(face), pose.position)) {
    auto same = std::find_if(longest.begin(), longest.end(),
                             [&](const VisibleStretch& other) { return other.label == stretch.label; });
    if (same == longest.end()) {
      longest.push_back(stretch);
    } else if (stretch.Length() > same->Length()) {
      *same = stretch;
    }
  }
  std::vector<ScanSegment> segments;
  // Noise and spurious segments have random numbers of their own: without them the portions are the same.
  Random noise(MixSeed(random->Bits(), 1)), stray(MixSeed(random->Bits(), 2));
  const auto add = [&](const Eigen::Vector2d& start, const Eigen::Vector2d& end) {
    const Eigen::Vector2d a = pose.RobotFromFloor(start), b = pose.RobotFromFloor(end);
    if (options.sigma_m == 0) {
      segments.push_back({a, b, 1e-6, 1e-6, 10});
      return;
    }
    const Eigen::Vector2d along = (b - a).normalized(), normal(-along.y(), along.x());
    std::vector<Eigen::Vector2d> points;
    const int num_points = std::clamp(static_cast<int>((b - a).norm() / 0.05), 6, 200);
    for (int i = 0; i < num_points; ++i)
      points.push_back(a + (b - a) * i / (num_points - 1) + normal * noise.Normal(0, options.sigma_m));
    segments.push_back(FitSegment(points, options.sigma_m));
  };
  for (const VisibleStretch& stretch : longest) {
    const bool missing = random->Uniform() < options.missing_ratio;
    const double share = random->Uniform(0.5, 1), from = random->Uniform(0, 1 - share);
    if (stretch.Length() < options.min_length_m || missing) continue;
    // On the wall's straight line, from which its pieces may lie off by what cleaning allows.
    const Eigen::Vector2d wall_start = LabelStart(views.plan, stretch.label);
    const Eigen::Vector2d wall_along = (LabelEnd(views.plan, stretch.label) - wall_start).normalized();
    const auto on_wall = [&](const Eigen::Vector2d& point) {
      return Eigen::Vector2d(wall_start + wall_along.dot(point - wall_start) * wall_along);
    };
    const Eigen::Vector2d along = stretch.end - stretch.start;
    add(on_wall(stretch.start + from * along), on_wall(stretch.start + (from + share) * along));
  }
  const auto num_spurious =
      static_cast<int>(std::lround(options.spurious_ratio * static_cast<double>(segments.size())));
  for (int i = 0; i < num_spurious; ++i) {
    const double distance = stray.Uniform(1, 6), angle = stray.Uniform(-std::numbers::pi, std::numbers::pi);
    const Eigen::Vector2d middle =
        pose.position + distance * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const double turn = angle + std::numbers::pi / 2 + stray.Uniform(-1, 1), length = stray.Uniform(0.3, 2);
    const Eigen::Vector2d half = 0.5 * length * Eigen::Vector2d(std::cos(turn), std::sin(turn));
    add(middle - half, middle + half);
  }
  return segments;
}

}  // namespace cairn
