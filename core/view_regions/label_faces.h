#pragma once

#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/plan/views.h"
#include "core/view_regions/arrangement.h"
#include "core/view_regions/view_boundaries.h"
#include "core/view_regions/wall_rays.h"

namespace cairn {

// How many windows each label is seen through from a point, by looking between all vertices: labels
// ascending.  Tests compare label sets with it, and walks begin with it.  `place`: grid coordinates.
// O(n) rays.
std::vector<WindowChange> CountWindows(const FloorPlan& plan, const WallRays& rays,
                                       const Eigen::Vector2d& place);

struct LabelFacesResult {
  Views views;  // without index
  // Borders whose two label sets do not differ by the labels of their boundaries: 0 except for rounding.
  int64_t num_disagreements = 0;
};

// Gives the faces their label sets: that of the largest face of each connected part by looking around, the
// others by the changes at the borders on the way [Simsarian96 §2.2 step III].  Faces are renumbered in the
// order of the walk.  O(faces + changes).  Errors: Cancelled.
Result<LabelFacesResult> LabelFaces(const FloorPlan& plan, const WallRays& rays,
                                    const std::vector<ViewBoundary>& boundaries, Arrangement arrangement,
                                    Progress& progress);

}  // namespace cairn
