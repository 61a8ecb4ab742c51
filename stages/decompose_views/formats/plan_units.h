#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "stages/decompose_views/formats/input_plan.h"

namespace cairn::decompose_views {

// "auto": what the file says, metres where it says nothing, refused where a building cannot have that size.
inline constexpr char kUnitOfFile[] = "auto";
// What the option `units` may be: kUnitOfFile, "m", "cm", "mm", "in", "ft".
std::vector<std::string> PlanUnits();

// Metres of a unit of PlanUnits().  REQUIRES: it is one, and not kUnitOfFile
double MetresOf(const std::string& unit);

// All coordinates by a factor.
void ScalePlan(double factor, InputPlan* plan);

// What is known of a plan's unit.
struct UnitClaim {
  std::string unit = "m";  // of PlanUnits(): that in which the file's numbers were taken
  std::string by;          // what in the file says so: "$INSUNITS = 4"; empty: nothing does
  bool is_given = false;   // the user says so
  std::string degrees_by;  // what says that coordinates are degrees; empty: nothing does
};

// Whether a building can have this size, in metres: it is 10 cm across at least, and, unless the user says in
// which unit it is, its extent times its median wall is 20,000 m^2 at most.  Both grow with the unit, so the
// product tells a wrong one by its square: the seven real plans of bench/views have 2 to 434 m^2 in metres,
// 22,000 to 4,300,000 in centimetres, and more in millimetres. In inches six of the seven are above; feet
// cannot be told from metres. Errors: Unsupported: the extent, the median wall, what these numbers would be
// in a unit that fits, or in degrees, and what to do.
Status CheckPlanSize(const InputPlan& plan, const UnitClaim& claim, const std::string& what);

}  // namespace cairn::decompose_views
