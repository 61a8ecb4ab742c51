#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/plan/views.h"
#include "core/plan/visible_walls.h"

namespace cairn {

// A path without the points that it can skip, where `is_free(from, to)` says so; from each point it goes to
// the last point that it can reach.
template <typename Point, typename IsFree>
std::vector<Point> Tightened(const std::vector<Point>& points, const IsFree& is_free) {
  std::vector<Point> tight{points[0]};
  for (size_t i = 0; i + 1 < points.size();) {
    size_t next = points.size() - 1;
    while (next > i + 1 && !is_free(points[i], points[next])) --next;
    tight.push_back(points[next]);
    i = next;
  }
  return tight;
}

// The free space of the domain at a vertex between two neighbouring walls, from the wall towards `first`
// counter-clockwise to the one towards `last`.  At an end that stands free, `first` and `last` are the same.
struct WallCorner {
  GridPoint vertex, first, last;
};

// On which side of a wall along its way a point passes, in the direction of its motion.
enum PassingSide : unsigned { kLeftSide = 1, kRightSide = 2, kEitherSide = 3 };

// How a point may move straight from one place to another: sets of PassingSide at its arrival, by the side on
// which it leaves.  Where no wall lies along the way there is no difference between the sides.
struct Passage {
  unsigned from_left = 0, from_right = 0;

  bool IsOpen() const { return (from_left | from_right) != 0; }
  // Whether one that leaves on a side of `leaving` may arrive on a side of `arriving`.
  bool Joins(unsigned leaving, unsigned arriving) const {
    return (((leaving & kLeftSide) != 0 ? from_left : 0) & arriving) != 0 ||
           (((leaving & kRightSide) != 0 ? from_right : 0) & arriving) != 0;
  }
};

// The free space of a plan, to move and to look in: its box without the pieces of its walls.
//
// Whether something touches or crosses is decided on the plan's grid, in integers: a place counts as the
// grid's nearest point, and pieces that meet share a vertex.  So no gap opens at a joint, whatever its angle.
class PlanSpace {
 public:
  // `views` outlives this.
  explicit PlanSpace(const Views& views) : views_(views), locator_(views) {
    neighbour_offsets_.assign(views.num_faces() + 1, 0);
    ListNeighbours();
    ListPieces();
    ListCorners();
  }

  const Views& views() const { return views_; }
  FaceIdx FaceAt(const Eigen::Vector2d& place) const { return locator_.Find(place); }
  // Errors: InvalidArgument where a place lies in no region.
  Status CheckInside(const Eigen::Vector2d& place) const;
  // The stretches visible from a place in the domain; empty outside of it.
  std::vector<VisibleStretch> ViewFrom(const Eigen::Vector2d& place) const;
  // Whether a disc may move straight from a to b: its middle stays in the plan's box, and no wall comes
  // nearer to it than `radius_m`; radius 0: nothing of a wall, its ends included, is touched.
  bool IsFree(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_m) const;
  // How a point may move, or look, straight from a to b where it may touch walls, but not cross them: it
  // moves along a wall on one of its sides, and past an end or a joint on a side where no wall leaves it.
  // Walls on which a or b itself lies are not checked there.
  Passage PassageBetween(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  // Distance to the nearest wall.  O(walls).
  double Clearance(const Eigen::Vector2d& place) const;
  // All, in the order of their vertices.
  const std::vector<WallCorner>& gaps() const { return gaps_; }
  // Those of more than 180 degrees, where walls jut out into the domain: a shortest path turns nowhere else.
  const std::vector<WallCorner>& corners() const { return corners_; }

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
  void ListPieces();
  void ListCorners();
  // More than rounding can move a place: pieces are listed in all cells that they come this near to.
  double CellMargin() const;
  // The nearest point of the grid; none outside of the plan's box.
  std::optional<GridPoint> OnGrid(const Eigen::Vector2d& place) const;
  // Calls visit(cell) for the cells that come within `radius_m` of a segment, until it returns false.
  template <typename Visit>
  bool VisitCells(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_m, Visit&& visit) const;

  const Views& views_;
  FaceLocator locator_;
  std::vector<int64_t> neighbour_offsets_;
  std::vector<Neighbour> neighbours_;
  std::vector<WallCorner> gaps_, corners_;
  // Pieces of walls by the cells of a grid that they lie in.
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 1;
  int num_columns_ = 1, num_rows_ = 1;
  struct CellPiece {
    GridPoint start, end;
  };
  std::vector<std::vector<CellPiece>> cell_pieces_;
};

}  // namespace cairn
