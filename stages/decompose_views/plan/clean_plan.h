#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/options/options.h"
#include "core/plan/floor_plan.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::decompose_views {

struct CleanPlanOptions {
  // Unit of all coordinates, metres: vertices of the plan and of its regions are rounded to it.
  // REQUIRES: in [1e-6, 0.01]
  double grid_m = 1e-5;
  // Ends of walls this close to each other, or to another wall, are moved together.  REQUIRES: in [0, 1]
  double snap_m = 0.01;
  // Walls that continue each other become one where no vertex lies farther than this from it.
  // REQUIRES: in [0, 1]
  double simplify_m = 0.005;
  // Open plans: how far the domain reaches beyond the walls, metres.  REQUIRES: in [0.01, 1000]
  double margin_m = 1.0;
};

enum class PlanChangeKind {
  kNoLength = 0,     // a wall shorter than the grid, left out
  kEndMoved = 1,     // an end of a wall, to an end of another
  kEndOnWall = 2,    // an end of a wall, onto another
  kDuplicate = 3,    // a wall that occurred before, left out
  kOverlap = 4,      // a part that two walls share, kept once
  kCrossing = 5,     // a vertex where walls cross or touch
  kPointRemoved = 6  // an end between two walls that continue each other; the walls became one
};
const char* PlanChangeName(PlanChangeKind kind);

// Something of the input that cleaning changed.
struct PlanChange {
  PlanChangeKind kind{};
  int line = 0;  // of the input; GeoJSON: the ring's number; 0: not of a single line
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // metres
  double moved_m = 0;                               // how far, where something was moved
};

struct CleanPlanResult {
  FloorPlan plan;
  std::vector<PlanChange> changes;
};

// Makes walls of a file into a plan whose walls meet at vertices only, and lists everything that was changed.
// Walls are not prolonged, and gaps are not closed.  A closed plan must be valid as polygons are (simple
// rings, holes inside, interiors apart), before and after; its walls then lie on its rings.  Deterministic.
// O(n log n) for n walls that are not much longer than they are far from each other.  Errors: InvalidArgument
// (options), Corrupt (an invalid polygon: what and where), NoData (no wall is left), Unsupported (extents
// beyond the grid, more than 200,000 walls), Cancelled.
Result<CleanPlanResult> CleanPlan(const InputPlan& input, const CleanPlanOptions& options,
                                  Progress& progress);

}  // namespace cairn::decompose_views
