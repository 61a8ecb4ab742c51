#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "runtime/paths/floor_pieces.h"
#include "runtime/paths/plan_path.h"
#include "runtime/paths/plan_space.h"

namespace cairn {

// A connected part of the floor.
struct FloorPart {
  double area_m2 = 0;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // the middle of its largest piece; floor frame, metres
  std::vector<ConvexPiece> pieces;
};

struct SearchPath {
  PlanPath path;
  std::vector<Eigen::Vector2d> places;  // to look around from, in the order of the path; the start first
  // No search from the start that looks around there sees all with fewer places: proven, up to rounding.  1
  // where less than all is asked for.
  int fewest_places = 1;

  // Of the domain: seen from the places, and seen from any place that the robot gets to.  The difference is
  // what `seen_ratio` allows, and slivers of less than 1 cm2 each.
  double domain_area_m2 = 0, seen_area_m2 = 0, visible_area_m2 = 0;
  // Parts that are seen from no place that the robot gets to, largest first.
  std::vector<FloorPart> unseen;
  double unseen_area_m2() const { return domain_area_m2 - visible_area_m2; }
  // Where the robot's middle does not get: nearer to walls than its radius, and what is cut off.
  double unreached_area_m2 = 0;
};

// A path from which all is seen that can be seen: looking places of which together no fewer are found,
// visited in the order of a tour that 2-opt has shortened.
//
// Places are chosen by the regions that they see (a region counts when its middle and its corners are seen,
// in plans of more than max_num_places regions the largest of each cell for the others there).  What is seen
// is measured: the domain, in pieces, without what each place sees.  Of what is left, in pieces of 0.1 m, the
// middle of each is looked for: from the places known, from where the robot may be on it, and from the
// borders of what it sees itself; if it can be seen, a place is added, the one that adds the most first,
// otherwise the piece is unseen.  Errors: as FindPath.
Result<SearchPath> FindSearchPath(const PlanSpace& space, const Eigen::Vector2d& from,
                                  const PlanPathOptions& options);

}  // namespace cairn
