// [Sala06 Table I] Random floor plans.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "sim/worlds/simulate_worlds.h"
#include "sim/worlds/walls.h"

namespace cairn::sim {
namespace {

// Free space that is left between obstacles and around them, so that a robot can pass.
constexpr double kPassageM = 1.0;
// Tries to place an obstacle before it is left out: the floor is full.
constexpr int kMaxTries = 50;

bool IsRectangular(int setting) { return setting <= 2; }
bool IsWidelyVisible(int setting) { return setting % 2 == 0; }

int RoundedNormal(double mean, double sigma, Random* random) {
  return static_cast<int>(std::lround(random->Normal(mean, sigma)));
}

// Vertices at equal angles, jittered by a quarter of a step, each with its own distance from the middle.
Polygon DrawPolygon(const Eigen::Vector2d& center, int num_sides, double radius_m, double radius_sigma,
                    Random* random) {
  Polygon polygon;
  const double turn = random->Uniform(0, 2 * std::numbers::pi);
  for (int i = 0; i < num_sides; ++i) {
    const double angle = turn + 2 * std::numbers::pi * (i + random->Uniform(-0.25, 0.25)) / num_sides;
    const double radius = std::max(0.4 * radius_m, random->Normal(radius_m, radius_sigma));
    polygon.push_back(center + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return polygon;
}

Polygon Rectangle(const Eigen::Vector2d& center, double half_width, double half_height) {
  return {
      center + Eigen::Vector2d(-half_width, -half_height), center + Eigen::Vector2d(half_width, -half_height),
      center + Eigen::Vector2d(half_width, half_height), center + Eigen::Vector2d(-half_width, half_height)};
}

Polygon DrawPerimeter(const SimulateWorldsOptions& options, Random* random) {
  const double radius = options.radius_m * std::sqrt(options.area_scale);
  if (IsRectangular(options.setting)) {
    const double half_width = random->Normal(radius, 0.1 * radius),
                 half_height = random->Normal(radius, 0.1 * radius);
    return Rectangle(Eigen::Vector2d::Zero(), half_width, half_height);
  }
  // [Sala06 §VI-A] sides: U(4, 4) w.p. 0.1, N(5, 0.5) w.p. 0.45, N(7, 2) w.p. 0.45
  const double which = random->Uniform();
  const int num_sides = which < 0.1    ? 4
                        : which < 0.55 ? RoundedNormal(5, 0.5, random)
                                       : RoundedNormal(7, 2, random);
  return DrawPolygon(Eigen::Vector2d::Zero(), std::clamp(num_sides, 4, 12), 1.1 * radius, 0.1 * radius,
                     random);
}

int DrawNumObstacles(const SimulateWorldsOptions& options, Random* random) {
  // [Sala06 §VI-A] irregular: U(5, 9) or N(8, 2); rectangular: U(6, 9) or N(10, 2), each w.p. 0.5
  const bool rectangular = IsRectangular(options.setting);
  const bool uniform = random->Uniform() < 0.5;
  const int num = uniform ? static_cast<int>(random->UniformInt(rectangular ? 6 : 5, 9))
                          : RoundedNormal(rectangular ? 10 : 8, 2, random);
  return static_cast<int>(std::lround(std::max(0, num) * options.area_scale));
}

// Obstacles at random places, each a passage away from the perimeter and from those before it.
void DrawObstacles(const SimulateWorldsOptions& options, Random* random, WorldPlan* plan) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& vertex : plan->perimeter) box.extend(vertex);
  const int num_obstacles = DrawNumObstacles(options, random);
  WallIndex walls({plan->perimeter}, 5.0);
  for (int i = 0; i < num_obstacles; ++i) {
    for (int attempt = 0; attempt < kMaxTries; ++attempt) {
      const double y = random->Uniform(box.min().y(), box.max().y());
      const double x = random->Uniform(box.min().x(), box.max().x());
      const Eigen::Vector2d center(x, y);
      const double radius = random->Uniform(options.min_obstacle_radius_m, options.max_obstacle_radius_m);
      const double aspect = random->Uniform(0.5, 1.0);
      const Polygon obstacle = IsRectangular(options.setting)
                                   ? Rectangle(center, radius, aspect * radius)
                                   : DrawPolygon(center, static_cast<int>(random->UniformInt(3, 7)), radius,
                                                 0.15 * radius, random);
      const double reach = 1.5 * radius + kPassageM;
      if (!Contains(plan->perimeter, center) || walls.AnyWithin(center, reach)) continue;
      walls.Add(obstacle);
      plan->obstacles.push_back(obstacle);
      break;
    }
  }
}

struct Side {
  Eigen::Vector2d from, to;
  Eigen::Vector2d normal;  // into free space
};

std::vector<Side> Sides(const WorldPlan& plan) {
  std::vector<Side> sides;
  const auto add = [&](const Polygon& polygon, double sign) {
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      const Eigen::Vector2d left = Eigen::Vector2d(a.y() - b.y(), b.x() - a.x()).normalized();
      sides.push_back({a, b, sign * left});
    }
  };
  add(plan.perimeter, 1);  // counter-clockwise: its inside is to the left
  for (const Polygon& obstacle : plan.obstacles) add(obstacle, -1);
  return sides;
}

void DrawFeatures(const SimulateWorldsOptions& options, Random* random, WorldPlan* plan) {
  static constexpr int kNumFeatures[] = {5400, 1700, 5000, 1700};
  const int num_features = static_cast<int>(
      std::lround((options.num_features > 0 ? options.num_features : kNumFeatures[options.setting - 1]) *
                  options.area_scale));
  const std::vector<Side> sides = Sides(*plan);
  std::vector<double> ends;  // along all walls
  double length = 0;
  for (const Side& side : sides) ends.push_back(length += (side.to - side.from).norm());
  const bool wide = IsWidelyVisible(options.setting);
  for (int i = 0; i < num_features; ++i) {
    const double at = random->Uniform(0, length);
    const Side& side = sides[std::upper_bound(ends.begin(), ends.end() - 1, at) - ends.begin()];
    const double along = random->Uniform();
    SimulatedFeature feature{side.from + along * (side.to - side.from), side.normal};
    // [Sala06 §VI-A] type 1: N(0.65, 0.2) to N(12.5, 1) m and N(25, 3) degrees; type 2: to N(17.5, 2) m,
    // N(45, 4)
    feature.near_m = std::max(0.0, random->Normal(0.65, 0.2));
    feature.far_m = std::max(feature.near_m, wide ? random->Normal(17.5, 2) : random->Normal(12.5, 1));
    feature.opening_deg = std::clamp(wide ? random->Normal(45, 4) : random->Normal(25, 3), 1.0, 179.0);
    plan->features.push_back(feature);
  }
}

}  // namespace

WorldPlan DrawFloorPlan(const SimulateWorldsOptions& options, uint64_t seed) {
  Random random(MixSeed(seed, static_cast<uint64_t>(options.setting)));
  // [Sala06 Table I] perimeter, obstacles, features
  WorldPlan plan;
  plan.perimeter = DrawPerimeter(options, &random);
  DrawObstacles(options, &random, &plan);
  DrawFeatures(options, &random, &plan);
  return plan;
}

}  // namespace cairn::sim
