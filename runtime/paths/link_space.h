#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/plan/floor_plan.h"
#include "runtime/paths/plan_space.h"
#include "runtime/paths/point_view.h"

namespace cairn {

// Where the middle of a robot may be, bounded by straight segments, and the corners at which a straight link
// can touch it.  In grid coordinates (real-valued).
//
//   kOuter  holds every place that a robot may be at: what cannot be done here cannot be done at all
//   kInner  holds only places that it may be at, except near `from` and `to`: see the constructor
//
// For a disc, walls are grown by polygons in (kOuter) or around (kInner) the circles about their ends.  For a
// point kOuter is the walls themselves: links may touch them, and are told from those that cross in
// integers; kInner keeps a few units of the grid away.
class LinkSpace {
 public:
  enum class Bound { kInner, kOuter };

  // A corner: the free directions begin at `from` and go counter-clockwise over `free_angle`, more than pi.
  struct Corner {
    Eigen::Vector2d place;
    double from = 0, free_angle = 0;  // radians
  };

  // kInner: what would be grown over `from` or `to`, places that the robot fits at, is not grown.  `space`
  // outlives this.
  LinkSpace(const PlanSpace& space, double radius_m, Bound bound, const Eigen::Vector2d& from,
            const Eigen::Vector2d& to);

  const std::vector<Corner>& corners() const { return corners_; }
  // `from` and `to` in grid coordinates; for a point the nearest points of the grid.
  const Eigen::Vector2d& from() const { return from_; }
  const Eigen::Vector2d& to() const { return to_; }
  // By how much a direction is widened where touching is allowed, radians.
  double slack() const { return touches_ ? kSlack : 0; }

  // What is seen in each direction from `from`, `to` or a corner, of the links that touch the corner's walls
  // on one side or go past its end.
  std::vector<BlockedArc> ViewFrom(const Eigen::Vector2d& place) const;
  std::vector<BlockedArc> ViewFrom(const Corner& corner) const;
  // How far a link from a corner gets in a direction; 0 where it would run along a wall.
  double Reach(const Corner& corner, const std::vector<BlockedArc>& view, double angle) const;

 private:
  struct Segment {
    Eigen::Vector2d start, end;
  };
  static constexpr double kSlack = 1e-9;

  void AddGrown(double radius_m, bool outer);
  void AddChain(const WallCorner& gap, double radius, bool outer, double radius_m);
  void AddBox(double margin);
  std::vector<BlockedArc> TouchingView(const Eigen::Vector2d& place, const Corner* corner) const;

  const PlanSpace& space_;
  const FloorPlan& plan_;
  const bool touches_;  // a point, kOuter: blockers are the plan's pieces
  Eigen::Vector2d from_, to_;
  std::vector<Segment> segments_;
  std::vector<Corner> corners_;
};

// The two ranges of directions from a corner in which a straight link through it goes on behind it.
struct DirectionRange {
  double from = 0, width = 0;  // radians; from in [-pi, pi]
};
std::vector<DirectionRange> LinkDirections(const LinkSpace::Corner& corner);

}  // namespace cairn
