#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace cairn {

// Points by the cube of space that they lie in, to find those near a place.  The points must outlive it.
class PointGrid {
 public:
  PointGrid(const std::vector<Eigen::Vector3d>& points, double side) : points_(points), side_(side) {
    for (size_t i = 0; i < points.size(); ++i) cells_[CellOf(points[i])].push_back(static_cast<int>(i));
  }

  PointGrid(const std::vector<Eigen::Vector3d>&& points, double side) = delete;

  // Calls visit(index, distance) for all points within the side of a place.
  template <typename Visit>
  void ForNear(const Eigen::Vector3d& place, const Visit& visit) const {
    const auto [x, y, z] = CellOf(place);
    for (int64_t i = x - 1; i <= x + 1; ++i) {
      for (int64_t j = y - 1; j <= y + 1; ++j) {
        for (int64_t k = z - 1; k <= z + 1; ++k) {
          const auto cell = cells_.find({i, j, k});
          if (cell == cells_.end()) continue;
          for (const int index : cell->second) {
            const double distance = (points_[index] - place).norm();
            if (distance <= side_) visit(index, distance);
          }
        }
      }
    }
  }

 private:
  using Cell = std::array<int64_t, 3>;
  struct CellHash {
    size_t operator()(const Cell& cell) const {
      uint64_t hash = 0;
      for (const int64_t number : cell) hash = (hash ^ static_cast<uint64_t>(number)) * 0x9e3779b97f4a7c15ull;
      return hash ^ (hash >> 32);
    }
  };

  Cell CellOf(const Eigen::Vector3d& place) const {
    const Eigen::Vector3d cell = (place / side_).array().floor();
    return {static_cast<int64_t>(cell.x()), static_cast<int64_t>(cell.y()), static_cast<int64_t>(cell.z())};
  }

  const std::vector<Eigen::Vector3d>& points_;
  double side_;
  std::unordered_map<Cell, std::vector<int>, CellHash> cells_;
};

}  // namespace cairn
