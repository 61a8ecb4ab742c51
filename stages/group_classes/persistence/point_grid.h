#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace cairn::group_classes {

// Points of space in cubes, for neighbours within a radius of one edge.
class PointGrid {
 public:
  PointGrid(double edge, const std::vector<Eigen::Vector3d>& points) : edge_(edge), points_(points) {
    for (size_t i = 0; i < points.size(); ++i)
      cells_[KeyOf(CellOf(points[i]))].push_back(static_cast<int>(i));
  }
  template <typename Body>
  void ForNeighbours(const Eigen::Vector3d& point, const Body& body) const {
    const Eigen::Vector3i at = CellOf(point);
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          const auto cell = cells_.find(KeyOf(at + Eigen::Vector3i(x, y, z)));
          if (cell == cells_.end()) continue;
          for (const int i : cell->second) {
            const double squared = (points_[i] - point).squaredNorm();
            if (squared <= edge_ * edge_) body(i, squared);
          }
        }
      }
    }
  }

 private:
  Eigen::Vector3i CellOf(const Eigen::Vector3d& point) const {
    return (point / edge_).array().floor().max(-1e6).min(1e6).cast<int>();
  }
  static int64_t KeyOf(const Eigen::Vector3i& cell) {
    return ((cell.x() + (int64_t{1} << 20)) * (int64_t{1} << 21) + cell.y() + (int64_t{1} << 20)) *
               (int64_t{1} << 21) +
           cell.z() + (int64_t{1} << 20);
  }
  const double edge_;
  const std::vector<Eigen::Vector3d>& points_;
  std::unordered_map<int64_t, std::vector<int>> cells_;
};

}  // namespace cairn::group_classes
