#include "stages/decompose_views/decompose_views.h"

#include <utility>

#include <Eigen/Geometry>

#include "core/geometry/pose.h"

namespace cairn::decompose_views {
namespace {

// The plan moved to the place that the options give.
InputPlan Placed(InputPlan plan, const DecomposeViewsOptions& options) {
  const Eigen::Vector2d origin(options.plan_x_m, options.plan_y_m);
  if (origin.isZero(0) && options.plan_heading_deg == 0) return plan;
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(RadFromDeg(options.plan_heading_deg)).toRotationMatrix();
  for (std::vector<Eigen::Vector2d>& ring : plan.rings) {
    for (Eigen::Vector2d& point : ring) point = turn * point + origin;
  }
  for (InputSegment& segment : plan.segments) {
    segment.start = turn * segment.start + origin;
    segment.end = turn * segment.end + origin;
  }
  return plan;
}

}  // namespace

OptionTable DescribeOptions(DecomposeViewsOptions* o) {
  OptionTable table = DescribeOptions(&o->read);
  const OptionTable more = {
      {.name = "plan_x_m",
       .value = &o->plan_x_m,
       .help = "place of the origin of the plan's file in the survey's floor frame, x in metres",
       .min = -1e7,
       .max = 1e7},
      {.name = "plan_y_m",
       .value = &o->plan_y_m,
       .help = "place of the origin of the plan's file in the survey's floor frame, y in metres",
       .min = -1e7,
       .max = 1e7},
      {.name = "plan_heading_deg",
       .value = &o->plan_heading_deg,
       .help = "direction of the plan's x axis in the survey's floor frame, counter-clockwise, degrees",
       .min = -360,
       .max = 360},
      {.name = "grid_m",
       .value = &o->clean.grid_m,
       .help = "unit that all coordinates are rounded to, metres",
       .min = 1e-6,
       .max = 0.01},
      {.name = "snap_m",
       .value = &o->clean.snap_m,
       .help = "ends of walls this close to each other, or to another wall, are moved together, metres",
       .min = 0,
       .max = 1},
      {.name = "simplify_m",
       .value = &o->clean.simplify_m,
       .help =
           "walls that continue each other become one where no point lies farther than this from it, metres",
       .min = 0,
       .max = 1},
      {.name = "margin_m",
       .value = &o->clean.margin_m,
       .help = "how far the domain extends beyond walls that do not form polygons, metres",
       .min = 0.01,
       .max = 1000},
      {.name = "min_region_area_m2",
       .value = &o->min_region_area_m2,
       .help = "regions smaller than this are joined to a neighbour, square metres; 0: none",
       .min = 0,
       .max = 1e6},
  };
  table.insert(table.end(), more.begin(), more.end());
  return table;
}

Result<DecomposeViewsResult> DecomposeViews(const InputPlan& input, const DecomposeViewsOptions& options,
                                            int num_threads, int64_t memory_mib, Progress& progress) {
  DecomposeViewsOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  CAIRN_ASSIGN_OR_RETURN(CleanPlanResult cleaned, CleanPlan(Placed(input, options), options.clean, progress));
  CAIRN_ASSIGN_OR_RETURN(DerivedViews derived, DeriveViews(cleaned.plan, num_threads, memory_mib, progress));
  DecomposeViewsResult result;
  if (options.min_region_area_m2 > 0)
    result.loss = MergeSmallRegions(options.min_region_area_m2, &derived.views);
  result.views = std::move(derived.views);
  result.num_disagreements = derived.num_disagreements;
  result.changes = std::move(cleaned.changes);
  result.num_boundaries = derived.num_boundaries;
  return result;
}

}  // namespace cairn::decompose_views
