#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/options/options.h"
#include "core/plan/views.h"
#include "core/view_regions/derive_views.h"
#include "stages/decompose_views/merge_regions.h"
#include "stages/decompose_views/plan/clean_plan.h"
#include "stages/decompose_views/plan/read_plan.h"

namespace cairn::decompose_views {

// Cleans a floor plan and divides it into the regions from all points of which a laser sees the same walls
// (view-invariant regions, VIRs; core/view_regions/derive_views.h).  Before: a floor plan.  After:
// localization with laser scans (runtime).  Implements [Simsarian96 §2.2].
struct DecomposeViewsOptions {
  ReadPlanOptions read;  // how the plan's file is read, before
  CleanPlanOptions clean;
  // Where the plan lies: its origin, and the direction of its x axis, counter-clockwise, in the frame of the
  // views (a survey's floor).  Regions, walls and lists of changes are in that frame.
  double plan_x_m = 0, plan_y_m = 0, plan_heading_deg = 0;
  // Regions smaller than this are joined to a neighbour, whose labels they get; 0: none.  The loss is
  // reported.  REQUIRES: >= 0
  double min_region_area_m2 = 0;
};
OptionTable DescribeOptions(DecomposeViewsOptions* options);

struct DecomposeViewsResult {
  Views views;
  std::vector<PlanChange> changes;  // of the plan, by cleaning
  int64_t num_boundaries = 0;
  // Borders whose two label sets do not differ by the labels of the boundaries between them; 0 except
  // for rounding.
  int64_t num_disagreements = 0;
  MergeLoss loss;
};

// Pure: same plan and options, same result for any number of threads.  Errors: InvalidArgument (options),
// those of CleanPlan and of DeriveViews.
Result<DecomposeViewsResult> DecomposeViews(const InputPlan& input, const DecomposeViewsOptions& options,
                                            int num_threads, int64_t memory_mib, Progress& progress);

}  // namespace cairn::decompose_views
