#pragma once

#include <vector>

#include "core/plan/floor_plan.h"

namespace cairn {

// Finds what lies along a ray or between two vertices, exactly.  Pieces lie in the cells of a grid.
class WallRays {
 public:
  // `plan` outlives this.
  explicit WallRays(const FloorPlan& plan);

  // What a ray from vertex `from`, in the direction from `through` to `from`, meets first: a vertex on it, or
  // a piece that it crosses.
  struct Hit {
    int32_t vertex = -1;
    int32_t piece = -1;
    Eigen::Vector2d place = Eigen::Vector2d::Zero();  // grid coordinates
    bool none() const { return vertex < 0 && piece < 0; }
  };
  // The ray begins at vertex `from`, in the direction vertex `through` -> `from`.
  Hit Beyond(int32_t through, int32_t from) const;

  // Whether nothing touches the open segment between two vertices, except a piece that joins them.
  bool Free(int32_t a, int32_t b) const;

  // The side of the wall that a ray in general position meets first, -1: none.  REQUIRES: origin and
  // direction in grid coordinates, no vertex near to the ray.
  LabelIdx Look(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction,
                double* distance = nullptr) const;

  // Pieces at a vertex.
  const std::vector<int32_t>& PiecesAt(int32_t vertex) const { return at_vertex_[vertex]; }

 private:
  // Calls visit(piece, limit) for pieces in the cells along origin + t * direction, t in [0, t_end], until it
  // returns a t before the cell's end.
  template <typename Visit>
  void Walk(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, double t_end,
            Visit&& visit) const;

  const FloorPlan& plan_;
  std::vector<std::vector<int32_t>> at_vertex_;
  Eigen::Vector2d low_, high_;
  double cell_ = 1;
  int num_columns_ = 1, num_rows_ = 1;
  std::vector<int32_t> cell_offsets_, cell_pieces_;
};

}  // namespace cairn
