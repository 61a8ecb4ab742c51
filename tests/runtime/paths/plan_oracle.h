#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "core/base/random.h"
#include "core/geometry/vector_geometry.h"

namespace cairn {

// Paths among walls by brute force, of the walls as they were given: none of the plan's grid, pieces, corners
// or regions.  What touches is told from what crosses by moving aside: next to every joint stand places a
// hair from it, several in each of the angles between its walls, and a link between places touches no
// wall at all.
class PlanOracle {
 public:
  using Vec2 = Eigen::Vector2d;
  struct Wall {
    Vec2 start, end;
  };
  static constexpr double kHair = 2e-5;  // metres: less than any other distance of these plans

  // The domain is the box around the walls with a margin of one metre.  Walls of no length are left out.
  explicit PlanOracle(const std::vector<Wall>& walls) {
    for (const Wall& wall : walls) {
      text_ += fmt::format("{},{},{},{}\n", wall.start.x(), wall.start.y(), wall.end.x(), wall.end.y());
      if (wall.start != wall.end) walls_.push_back(wall);
    }
    low_ = high_ = walls_[0].start;
    for (const Wall& wall : walls_) {
      low_ = low_.cwiseMin(wall.start).cwiseMin(wall.end);
      high_ = high_.cwiseMax(wall.start).cwiseMax(wall.end);
    }
    low_.array() -= 1;
    high_.array() += 1;
    std::vector<Vec2> joints;
    for (size_t i = 0; i < walls_.size(); ++i) {
      joints.push_back(walls_[i].start);
      joints.push_back(walls_[i].end);
      for (size_t k = 0; k < i; ++k) {
        if (const auto crossing = Crossing(walls_[i], walls_[k])) joints.push_back(*crossing);
      }
    }
    for (const Vec2& joint : joints) {
      if (std::any_of(joints_.begin(), joints_.end(),
                      [&](const Joint& other) { return (other.at - joint).norm() < 1e-9; }))
        continue;
      joints_.push_back({joint, PlacesAround(joint)});
    }
  }

  // As a plan's file.
  const std::string& Text() const { return text_; }

  double Clearance(const Vec2& a, const Vec2& b) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Wall& wall : walls_) nearest = std::min(nearest, Distance(wall, {a, b}));
    return nearest;
  }

  // Length of the shortest path of a point that crosses no wall; none: there is no path.
  std::optional<double> ShortestLength(const Vec2& from, const Vec2& to) const {
    std::vector<Vec2> places{from, to};
    for (const Joint& joint : joints_) places.insert(places.end(), joint.around.begin(), joint.around.end());
    return ShortestOver(places, 0);
  }

  // The same of a disc, over 64 places around each end of a wall.
  std::optional<double> ShortestLength(const Vec2& from, const Vec2& to, double radius_m) const {
    std::vector<Vec2> places{from, to};
    for (const Wall& wall : walls_) {
      for (const Vec2& end : {wall.start, wall.end}) {
        for (int i = 0; i < 64; ++i) {
          const double angle = std::numbers::pi * i / 32;
          const Vec2 place =
              end + 1.0013 * radius_m * Vec2(std::cos(angle), std::sin(angle));  // 1 / cos(pi / 64)
          if (IsClear(place, place, radius_m)) places.push_back(place);
        }
      }
    }
    return ShortestOver(places, radius_m);
  }

  // A lattice of places over the domain, none of them nearer than `clearance_m` to a wall.
  std::vector<Vec2> Lattice(double step_m, double clearance_m) const {
    std::vector<Vec2> places;
    for (double x = low_.x() + 0.41 * step_m; x < high_.x(); x += step_m) {
      for (double y = low_.y() + 0.37 * step_m; y < high_.y(); y += step_m) {
        if (IsClear({x, y}, {x, y}, clearance_m)) places.emplace_back(x, y);
      }
    }
    return places;
  }

  // The fewest links of a path with turns at these places, which keeps `clearance_m` from walls; none: there
  // is none.
  std::optional<int> FewestLinks(const Vec2& from, const Vec2& to, std::vector<Vec2> turns,
                                 double clearance_m) const {
    std::vector<Vec2> now{from};
    for (int num_links = 1; !now.empty(); ++num_links) {
      std::vector<Vec2> next;
      for (const Vec2& at : now) {
        if (IsClear(at, to, clearance_m)) return num_links;
        const auto seen = std::stable_partition(
            turns.begin(), turns.end(), [&](const Vec2& turn) { return !IsClear(at, turn, clearance_m); });
        next.insert(next.end(), seen, turns.end());
        turns.erase(seen, turns.end());
      }
      now = std::move(next);
    }
    return std::nullopt;
  }

  // Those of these places that are reached from one, from place to place.
  std::vector<Vec2> ReachedOf(const Vec2& from, std::vector<Vec2> places, double clearance_m) const {
    std::vector<Vec2> reached{from};
    for (size_t i = 0; i < reached.size(); ++i) {
      const auto seen = std::stable_partition(places.begin(), places.end(), [&](const Vec2& place) {
        return !IsClear(reached[i], place, clearance_m);
      });
      reached.insert(reached.end(), seen, places.end());
      places.erase(seen, places.end());
    }
    return reached;
  }

  bool Sees(const Vec2& place, const Vec2& point) const { return IsClear(place, point, 0); }

  // Whether a point can follow a path by less than a hair's breadth without touching a wall.
  bool CanBeWalked(const std::vector<Vec2>& points) const {
    std::vector<Vec2> reached{points[0]};
    for (size_t i = 0; i + 1 < points.size(); ++i) {
      // Joints on the way, in order, then its end.
      std::vector<std::pair<double, const Joint*>> stops;
      const Vec2 along = points[i + 1] - points[i];
      const Joint* at_end = nullptr;
      for (const Joint& joint : joints_) {
        if ((joint.at - points[i + 1]).norm() < 1e-5) at_end = &joint;
        const double share = along.dot(joint.at - points[i]) / along.squaredNorm();
        if (std::abs(Cross(along, joint.at - points[i])) < 1e-5 * along.norm() && share > 1e-5 &&
            share < 1 - 1e-5)
          stops.emplace_back(share, &joint);
      }
      std::sort(stops.begin(), stops.end());
      if (at_end != nullptr) stops.emplace_back(1, at_end);
      const auto go = [&](std::vector<Vec2> places) {
        std::vector<Vec2> now;
        for (bool found = true; found;) {
          // From before, and from one place around a joint to the next.
          found = false;
          for (size_t k = 0; k < places.size(); ++k) {
            const auto is_clear = [&](const Vec2& before) { return IsClear(before, places[k], 0); };
            if (std::none_of(reached.begin(), reached.end(), is_clear) &&
                std::none_of(now.begin(), now.end(), is_clear))
              continue;
            now.push_back(places[k]);
            places.erase(places.begin() + static_cast<std::ptrdiff_t>(k));
            found = true;
            break;
          }
        }
        reached = std::move(now);
      };
      for (const auto& [share, joint] : stops) go(joint->around);
      if (at_end == nullptr) go({points[i + 1]});
    }
    return !reached.empty();
  }

 private:
  struct Joint {
    Vec2 at;
    std::vector<Vec2> around;
  };

  static std::optional<Vec2> Crossing(const Wall& a, const Wall& b) {
    const Vec2 u = a.end - a.start, v = b.end - b.start;
    const double turn = Cross(u, v);
    if (std::abs(turn) < 1e-9) return std::nullopt;
    const double s = Cross(b.start - a.start, v) / turn, t = Cross(b.start - a.start, u) / turn;
    if (s < -1e-9 || s > 1 + 1e-9 || t < -1e-9 || t > 1 + 1e-9) return std::nullopt;
    return Vec2(a.start + s * u);
  }

  static double PointDistance(const Vec2& point, const Wall& wall) {
    const Vec2 along = wall.end - wall.start;
    const double squared = along.squaredNorm();
    const double share = squared > 0 ? std::clamp((point - wall.start).dot(along) / squared, 0.0, 1.0) : 0;
    return (point - wall.start - share * along).norm();
  }
  static double Distance(const Wall& a, const Wall& b) {
    const double nearest = std::min({PointDistance(a.start, b), PointDistance(a.end, b),
                                     PointDistance(b.start, a), PointDistance(b.end, a)});
    const auto apart = [](const Wall& x, const Wall& y) {
      const Vec2 along = x.end - x.start;
      return Cross(along, y.start - x.start) * Cross(along, y.end - x.start) > 0;
    };
    const bool parallel = std::abs(Cross(a.end - a.start, b.end - b.start)) == 0;
    return parallel || apart(a, b) || apart(b, a) ? nearest : 0;
  }

  bool IsClear(const Vec2& a, const Vec2& b, double radius_m) const {
    if ((a.array() < low_.array()).any() || (a.array() > high_.array()).any() ||
        (b.array() < low_.array()).any() || (b.array() > high_.array()).any())
      return false;
    return std::all_of(walls_.begin(), walls_.end(), [&](const Wall& wall) {
      const double distance = Distance({a, b}, wall);
      return radius_m > 0 ? distance >= radius_m : distance > 1e-9;
    });
  }

  // A hair from a joint, at most 30 degrees apart, in the middle of each angle between its walls.
  std::vector<Vec2> PlacesAround(const Vec2& joint) const {
    std::vector<double> angles;
    for (const Wall& wall : walls_) {
      if (PointDistance(joint, wall) > 1e-9) continue;
      for (const Vec2& end : {wall.start, wall.end}) {
        const Vec2 arm = end - joint;
        if (arm.norm() > 1e-9) angles.push_back(std::atan2(arm.y(), arm.x()));
      }
    }
    std::vector<Vec2> places;
    std::sort(angles.begin(), angles.end());
    for (size_t i = 0; i < angles.size(); ++i) {
      const double next = i + 1 < angles.size() ? angles[i + 1] : angles[0] + 2 * std::numbers::pi;
      const double free_angle = next - angles[i];
      if (free_angle < 1e-9) continue;
      // An odd number, for one to be in the middle.
      const int num = 2 * static_cast<int>(free_angle / (std::numbers::pi / 3)) + 1;
      for (int k = 0; k < num; ++k) {
        const double angle = angles[i] + free_angle * (k + 0.5) / num;
        places.push_back(joint + kHair * Vec2(std::cos(angle), std::sin(angle)));
      }
    }
    return places;
  }

  std::optional<double> ShortestOver(const std::vector<Vec2>& places, double radius_m) const {
    std::vector<double> lengths(places.size(), std::numeric_limits<double>::infinity());
    std::vector<bool> done(places.size(), false);
    lengths[0] = 0;
    while (true) {
      size_t at = places.size();
      for (size_t i = 0; i < places.size(); ++i) {
        if (!done[i] && std::isfinite(lengths[i]) && (at == places.size() || lengths[i] < lengths[at]))
          at = i;
      }
      if (at == places.size()) return std::nullopt;
      if (at == 1) return lengths[1];
      done[at] = true;
      for (size_t i = 0; i < places.size(); ++i) {
        const double length = lengths[at] + (places[i] - places[at]).norm();
        if (!done[i] && length < lengths[i] && IsClear(places[at], places[i], radius_m)) lengths[i] = length;
      }
    }
  }

  std::string text_;
  std::vector<Wall> walls_;
  std::vector<Joint> joints_;
  Vec2 low_, high_;
};

// Walls between whole points of a small grid: they share ends, cross, touch, overlap, and some are there
// twice or have no length.
inline std::vector<PlanOracle::Wall> RandomWalls(Random& random, int num_walls, int size) {
  const auto point = [&] {
    return Eigen::Vector2d(static_cast<double>(random.UniformInt(0, size)),
                           static_cast<double>(random.UniformInt(0, size)));
  };
  std::vector<PlanOracle::Wall> walls;
  for (int i = 0; i < num_walls; ++i) {
    const double kind = random.Uniform();
    if (i == 0 || kind < 0.3) {
      walls.push_back({point(), point()});
    } else if (kind < 0.6) {  // on from another
      walls.push_back({walls[random.UniformInt(0, i - 1)].end, point()});
    } else if (kind < 0.7) {  // from one to another: closes rooms
      walls.push_back({walls[random.UniformInt(0, i - 1)].end, walls[random.UniformInt(0, i - 1)].start});
    } else if (kind < 0.85) {  // along an axis
      const Eigen::Vector2d start = point();
      const double length = static_cast<double>(random.UniformInt(1, size));
      walls.push_back({start, start + (random.Uniform() < 0.5 ? Eigen::Vector2d(length, 0)
                                                              : Eigen::Vector2d(0, length))});
    } else if (kind < 0.95) {  // again, turned round
      const PlanOracle::Wall wall = walls[random.UniformInt(0, i - 1)];
      walls.push_back({wall.end, wall.start});
    } else {
      const Eigen::Vector2d at = point();
      walls.push_back({at, at});
    }
  }
  if ((walls[0].end - walls[0].start).norm() == 0) walls[0].end.x() += 1;
  return walls;
}

}  // namespace cairn
