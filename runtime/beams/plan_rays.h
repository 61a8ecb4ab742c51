#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"
#include "core/plan/wall_cells.h"

namespace cairn {

// What lies along a ray: the walls of a plan in the cells of a grid.
class PlanRays {
 public:
  static constexpr int kMaxHits = 4;
  struct Hit {
    double distance_m = 0;
    int32_t wall = 0;
  };
  // The first walls along a ray, the nearest first.
  struct Hits {
    std::array<Hit, kMaxHits> at;
    int size = 0;

    const Hit* begin() const { return at.data(); }
    const Hit* end() const { return at.data() + size; }
  };

  // `walls` outlives this.
  explicit PlanRays(const std::vector<PlanWall>& walls);

  // Walls met within `reach_m`, both sides of each.  `direction`: of length 1.  O(cells passed + walls in
  // them)
  Hits Cast(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, double reach_m) const;

 private:
  const std::vector<PlanWall>& walls_;
  const CellGrid grid_;
  const WallsByCell by_cell_;
};

}  // namespace cairn
