#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/random.h"

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

// Divides points into windows of at most `most` by lines or planes across an axis, each across the longest
// side of what it divides, near its middle: where exactly is drawn from `random`, so that other windows have
// other borders.  `idxs`: of the points that are divided.  Each window ascending.  REQUIRES: most >= 1
template <int kDim>
std::vector<std::vector<int32_t>> DividePoints(const std::vector<Eigen::Matrix<double, kDim, 1>>& points,
                                               std::vector<int32_t> idxs, int most, Random* random) {
  constexpr double kLeastShare = 0.38;  // of the points, on each side
  std::vector<std::vector<int32_t>> windows, open;
  if (!idxs.empty()) open.push_back(std::move(idxs));
  while (!open.empty()) {
    std::vector<int32_t> window = std::move(open.back());
    open.pop_back();
    if (static_cast<int>(window.size()) <= most) {
      std::sort(window.begin(), window.end());
      windows.push_back(std::move(window));
      continue;
    }
    Eigen::Array<double, kDim, 1> low = points[window[0]], high = low;
    for (const int32_t i : window) {
      low = low.min(points[i].array());
      high = high.max(points[i].array());
    }
    int axis = 0;
    for (int k = 1; k < kDim; ++k) {
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    }
    const double share = random->Uniform(kLeastShare, 1 - kLeastShare);
    const auto middle =
        window.begin() + std::clamp<ptrdiff_t>(std::lround(share * static_cast<double>(window.size())), 1,
                                               std::ssize(window) - 1);
    std::nth_element(window.begin(), middle, window.end(), [&](int32_t a, int32_t b) {
      return std::pair(points[a][axis], a) < std::pair(points[b][axis], b);
    });
    open.emplace_back(middle, window.end());
    open.emplace_back(window.begin(), middle);  // is divided first
  }
  return windows;
}

}  // namespace cairn
