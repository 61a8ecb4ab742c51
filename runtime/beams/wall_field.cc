#include "runtime/beams/wall_field.h"

#include <limits>
#include <numbers>

#include "core/geometry/vector_geometry.h"

namespace cairn {
namespace {

constexpr double kFieldCellM = 0.1;
constexpr double kMaxFieldCells = 1 << 21;
constexpr double kSigmaCells = 1.2;
constexpr double kReachSigmas = 3.3;  // 255 exp(-3.3^2 / 2) = 1.1
constexpr double kFieldMarginM = 2;
// Directions of a layer: half of the step between layers, and what directions of points are off.
constexpr double kLayerReach = 37 * std::numbers::pi / 180;

}  // namespace

int WallField::LayerOf(double angle_rad) {
  const double turns = angle_rad / std::numbers::pi;
  return static_cast<int>((turns - std::floor(turns)) * kNumDirections + 0.5) % kNumDirections;
}

WallField::WallField(const std::vector<PlanWall>& walls)
    : grid_(GridAround(walls, kFieldMarginM, kFieldCellM, kMaxFieldCells)) {
  const double sigma = kSigmaCells * grid_.cell_m;
  reach_m_ = kReachSigmas * sigma;
  constexpr auto kFar = std::numeric_limits<float>::infinity();
  std::vector<float> squared(grid_.size(), kFar);
  nearest_.assign(grid_.size(), -1);
  for (int layer = 0; layer < kNumDirections; ++layer) {
    std::vector<float> of_layer(grid_.size(), kFar);
    for (int32_t i = 0; i < std::ssize(walls); ++i) {
      const Eigen::Vector2d along = walls[i].end - walls[i].start;
      const double turned = std::atan2(along.y(), along.x()) - layer * std::numbers::pi / kNumDirections;
      if (std::abs(std::remainder(turned, std::numbers::pi)) > kLayerReach) continue;
      ForCellsNear(grid_, walls[i], reach_m_, [&](int column, int row) {
        const size_t index = grid_.Index(column, row);
        const auto distance = static_cast<float>(
            std::pow(PointToSegment(grid_.Middle(column, row), walls[i].start, walls[i].end), 2));
        if (distance > reach_m_ * reach_m_) return;
        of_layer[index] = std::min(of_layer[index], distance);
        if (distance > squared[index] || (distance == squared[index] && nearest_[index] <= i)) return;
        squared[index] = distance;
        nearest_[index] = i;
      });
    }
    layers_.push_back(LevelsOf(of_layer, sigma));
  }
  layers_.push_back(LevelsOf(squared, sigma));
}

WallField::Levels WallField::LevelsOf(const std::vector<float>& squared, double sigma_m) const {
  Levels levels(kTopLevel + 1, std::vector<uint8_t>(grid_.size(), 0));
  for (size_t i = 0; i < squared.size(); ++i) {
    if (std::isfinite(squared[i]))
      levels[0][i] =
          static_cast<uint8_t>(std::lround(255 * std::exp(-0.5 * squared[i] / (sigma_m * sigma_m))));
  }
  for (int level = 1; level <= kTopLevel; ++level) {
    const int half = 1 << (level - 1);
    const std::vector<uint8_t>& from = levels[level - 1];
    for (int row = 0; row < grid_.num_rows; ++row) {
      const int beside = std::min(row + half, grid_.num_rows - 1);
      for (int column = 0; column < grid_.num_columns; ++column) {
        const int right = std::min(column + half, grid_.num_columns - 1);
        levels[level][grid_.Index(column, row)] =
            std::max({from[grid_.Index(column, row)], from[grid_.Index(right, row)],
                      from[grid_.Index(column, beside)], from[grid_.Index(right, beside)]});
      }
    }
  }
  return levels;
}

}  // namespace cairn
