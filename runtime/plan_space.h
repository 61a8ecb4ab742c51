#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/views.h"
#include "core/visible_walls.h"

namespace cairn {

// A path without the points that it can go straight past, where `is_free(from, to)` says so; of each point
// the last that it reaches.
template <typename IsFree>
std::vector<Eigen::Vector2d> Tightened(const std::vector<Eigen::Vector2d>& points, const IsFree& is_free) {
  std::vector<Eigen::Vector2d> tight{points[0]};
  for (size_t i = 0; i + 1 < points.size();) {
    size_t next = points.size() - 1;
    while (next > i + 1 && !is_free(points[i], points[next])) --next;
    tight.push_back(points[next]);
    i = next;
  }
  return tight;
}

// The free space of a plan, to move and to look in.
class PlanSpace {
 public:
  // `views` outlives this.
  explicit PlanSpace(const Views& views) : views_(views), locator_(views) {
    neighbour_offsets_.assign(views.num_faces() + 1, 0);
    ListNeighbours();
    ListWalls();
  }

  const Views& views() const { return views_; }
  FaceIdx FaceAt(const Eigen::Vector2d& place) const { return locator_.Find(place); }
  // Errors: InvalidArgument where a place lies in no region.
  Status CheckInside(const Eigen::Vector2d& place) const;
  // What is visible from a place in the domain; nothing outside of it.
  std::vector<VisibleStretch> ViewFrom(const Eigen::Vector2d& place) const;
  // Whether a disc may move straight from a to b without touching a wall; radius 0: a point.
  bool IsFree(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_m) const;

  // A way into a neighbouring region.
  struct Neighbour {
    FaceIdx face;
    Eigen::Vector2d middle;  // of the common border
  };
  const Neighbour* NeighboursBegin(FaceIdx face) const {
    return neighbours_.data() + neighbour_offsets_[face];
  }
  const Neighbour* NeighboursEnd(FaceIdx face) const {
    return neighbours_.data() + neighbour_offsets_[face + 1];
  }

 private:
  void ListNeighbours();
  void ListWalls();
  // Calls visit(cell) for the cells that come within `radius_m` of a segment, until it returns false.
  template <typename Visit>
  bool VisitCells(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_m, Visit&& visit) const;

  const Views& views_;
  FaceLocator locator_;
  std::vector<int64_t> neighbour_offsets_;
  std::vector<Neighbour> neighbours_;
  // Walls by the cells of a grid that they lie in.
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 1;
  int num_columns_ = 1, num_rows_ = 1;
  std::vector<std::vector<int32_t>> cell_walls_;
};

}  // namespace cairn
