#pragma once

#include <vector>

#include <Eigen/Core>

#include "runtime/paths/plan_space.h"
#include "runtime/paths/point_view.h"

namespace cairn {

// A convex polygon, counter-clockwise, metres.
using ConvexPiece = std::vector<Eigen::Vector2d>;

double AreaOf(const ConvexPiece& piece);
double AreaOf(const std::vector<ConvexPiece>& pieces);
Eigen::Vector2d CentroidOf(const ConvexPiece& piece);
// The part left of a line through `point` in a direction; empty where there is none.
ConvexPiece LeftOf(const ConvexPiece& piece, const Eigen::Vector2d& point, const Eigen::Vector2d& direction);
// Halves, quarters, ... until none is longer than `size_m`.
std::vector<ConvexPiece> Divided(const std::vector<ConvexPiece>& pieces, double size_m);

// The domain of a plan in trapezoids that no wall crosses.  O(n k log k) for n pieces of walls, of which an
// upright line crosses k.
std::vector<ConvexPiece> FloorPieces(const PlanSpace& space);

// What is seen from a place: up to the first wall, or the border of the plan's box, in each direction.
class LookAround {
 public:
  LookAround(const PlanSpace& space, const Eigen::Vector2d& place);

  const Eigen::Vector2d& place() const { return place_; }
  // Relative to the place, metres; they cover all directions.
  const std::vector<BlockedArc>& arcs() const { return arcs_; }
  bool Sees(const Eigen::Vector2d& point) const;
  // What of these is not seen.  Exact up to rounding: 1e-9 m2 a piece.
  std::vector<ConvexPiece> Hidden(const std::vector<ConvexPiece>& pieces) const;

 private:
  void AddHidden(const ConvexPiece& piece, std::vector<ConvexPiece>* hidden) const;

  Eigen::Vector2d place_;
  std::vector<BlockedArc> arcs_;
};

}  // namespace cairn
