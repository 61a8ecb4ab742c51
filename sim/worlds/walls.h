#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "sim/worlds/simulate_worlds.h"

namespace cairn::sim {

// Whether a point lies inside of a polygon; for points on its border either may be returned.
bool Contains(const Polygon& polygon, const Eigen::Vector2d& point);

// Walls in the cells of a grid, to find those near a place.
class WallIndex {
 public:
  using Wall = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

  // The grid spans the first polygon.
  WallIndex(const std::vector<Polygon>& polygons, double cell_m);
  void Add(const Polygon& polygon);

  // Whether some wall comes within `distance_m` of a point.
  bool AnyWithin(const Eigen::Vector2d& point, double distance_m) const;
  // Walls that may touch a box, each once, in the order in which they were added.
  std::vector<Wall> Near(const Eigen::AlignedBox2d& box) const;
  const std::vector<Wall>& walls() const { return walls_; }

 private:
  std::pair<int, int> CellOf(const Eigen::Vector2d& point) const;
  template <typename Visit>
  void VisitCells(const Eigen::AlignedBox2d& box, Visit&& visit) const;

  double cell_m_;
  Eigen::Vector2d origin_;
  int num_columns_, num_rows_;
  std::vector<Wall> walls_;
  std::vector<std::vector<int32_t>> cells_;
};

// Whether the segments ab and cd have a point in common, touching ends included.
bool SegmentsCross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                   const Eigen::Vector2d& d);

}  // namespace cairn::sim
