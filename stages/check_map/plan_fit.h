#pragma once

#include <map>
#include <string>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/options/options.h"

namespace cairn::check_map {

// Where a map has both images and a floor plan, each checks the other: neither was made from the other.
//
// Landmarks near the cameras' height lie mostly on walls; others, on furniture and people, have no effect.
// With d(p) the distance of landmark p from the nearest wall of the plan, the rigid motion M on the floor
// that maximises
//     sum over p of max(0, 1 - d(M p)^2 / s^2)
// is the identity where the plan fits; otherwise its inverse is the correction of the plan.
struct PlanFitOptions {
  // A landmark this close to a wall lies on it, metres.  REQUIRES: > 0
  double plan_wall_distance_m = 0.1;
  // Landmarks up to this far above or below the cameras' median height are used, metres.  REQUIRES: > 0
  double plan_height_band_m = 1;
  // Largest shift and turn of the plan that are tried, metres and degrees.  REQUIRES: > 0
  double plan_max_shift_m = 2;
  double plan_max_turn_deg = 10;
  // A plan that fits better when moved by more than this does not fit, metres and degrees.  REQUIRES: > 0
  double plan_tolerance_m = 0.15;
  double plan_tolerance_deg = 1;
  // A plan with a smaller part of the landmarks on its walls, however it is moved, does not fit
  // either.  REQUIRES: in [0, 1]
  double min_plan_on_walls_ratio = 0.3;
};
OptionTable DescribeOptions(PlanFitOptions* options);

struct PlanFit {
  int num_landmarks = 0;  // used
  int num_on_walls = 0;
  // Distances beyond kMaxWallDistanceM count as that.
  double median_wall_distance_m = 0;
  // With the plan moved as below.
  int num_on_walls_moved = 0;
  // The motion that would make the plan fit best: a turn about `center`, counter-clockwise, then a shift.
  Eigen::Vector2d center = Eigen::Vector2d::Zero();  // floor frame, metres
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();   // metres
  double turn_deg = 0;
  int num_images = 0;       // of the survey
  int num_images_free = 0;  // in a region of the plan
  bool fits = false;
};
inline constexpr double kMaxWallDistanceM = 0.5;

// Compares landmarks and camera places of the survey with the walls of the map's plan.  Pure.  O(motions *
// landmarks), of which at most 1500 are used.  Errors: InvalidArgument (an option), NoData (no plan; too few
// landmarks at the cameras' height).
Result<PlanFit> FitPlan(const MapRows& rows, const PlanFitOptions& options);

// As figures of the self-test: plan_num_landmarks, plan_on_walls_ratio, plan_median_wall_distance_m,
// plan_on_walls_ratio_moved, plan_shift_m, plan_turn_deg, plan_images_free_ratio, plan_fits (0 or 1).
void AddPlanFigures(const PlanFit& fit, std::map<std::string, double>* figures);

// In words: that the plan fits, or in what way it does not and which motion would help.
std::string PlanVerdict(const PlanFit& fit);

}  // namespace cairn::check_map
