// The C API's floor plans (runtime/c_api/cairn.h).
#include "runtime/c_api/plans/plans.h"

#include <algorithm>
#include <utility>

#include "runtime/c_api/calls.h"
#include "runtime/map/map.h"
#include "runtime/map/open_views.h"

namespace cairn {
namespace {

Handles<cairn_plan, const Views, HandleKind::kPlan>& OpenPlans() {
  static auto* plans = new Handles<cairn_plan, const Views, HandleKind::kPlan>;
  return *plans;
}

}  // namespace

Result<std::shared_ptr<const Views>> FindPlan(const cairn_plan* handle) {
  if (auto plan = OpenPlans().Find(handle)) return plan;
  if (handle == nullptr) return Misuse("plan is NULL");
  return Misuse("the handle is not a plan: it was closed, or never opened");
}

Result<RangeScan> RangeScanOf(const cairn_scan* given) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "scan"));
  if (given->num_beams < 1 || given->num_beams > kMaxBeams)
    return Misuse("scan->num_beams is {}; expected 1 to {}", given->num_beams, kMaxBeams);
  if (given->ranges_m == nullptr) return Misuse("scan->ranges_m is NULL");
  RangeScan scan;
  scan.first_angle_rad = given->first_angle_rad;
  scan.step_rad = given->step_rad;
  scan.ranges_m.assign(given->ranges_m, given->ranges_m + given->num_beams);
  if (given->angles_rad != nullptr)
    scan.angles_rad.assign(given->angles_rad, given->angles_rad + given->num_beams);
  if (given->max_range_m != 0) scan.max_range_m = given->max_range_m;
  CAIRN_RETURN_IF_ERROR(CheckRangeScan(scan));
  return scan;
}

Result<PossiblePlace> PossiblePlaceOf(const cairn_plan_place* given) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "place"));
  PossiblePlace place;
  place.pose = {Eigen::Vector2d(given->position_m), given->heading_rad};
  place.covariance = Eigen::Map<const Eigen::Matrix3d>(given->covariance);
  place.probability = given->probability;
  return place;
}

cairn_plan_place PlanPlaceFrom(const PossiblePlace& place, bool determined) {
  cairn_plan_place given = CAIRN_PLAN_PLACE_INIT;
  std::copy_n(place.pose.position.data(), 2, given.position_m);
  given.heading_rad = place.pose.heading_rad;
  std::copy_n(place.covariance.data(), 9, given.covariance);
  given.probability = place.probability;
  given.determined = determined ? 1 : 0;
  return given;
}

}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_plan_open(const char* path, cairn_plan** plan) {
  if (plan != nullptr) *plan = nullptr;
  return Call("cairn_plan_open", [&]() -> Status {
    if (path == nullptr) return Misuse("path is NULL");
    if (plan == nullptr) return Misuse("plan is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Views> open, OpenPlan(path));
    *plan = OpenPlans().Add(std::move(open));
    return Ok();
  });
}

int32_t cairn_map_plan(const cairn_map* map, cairn_plan** plan) {
  if (plan != nullptr) *plan = nullptr;
  return Call("cairn_map_plan", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    if (plan == nullptr) return Misuse("plan is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Views> of_map, open->Plan());
    *plan = OpenPlans().Add(std::move(of_map));
    return Ok();
  });
}

int32_t cairn_plan_walls(const cairn_plan* plan, double* ends_m, int32_t capacity, int32_t* num_walls) {
  if (num_walls != nullptr) *num_walls = 0;
  return Call("cairn_plan_walls", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto open, FindPlan(plan));
    if (num_walls == nullptr) return Misuse("num_walls is NULL");
    if (capacity < 0) return Misuse("capacity is {}; must not be negative", capacity);
    if (ends_m == nullptr && capacity > 0) return Misuse("ends_m is NULL, with a capacity of {}", capacity);
    *num_walls = open->plan.num_walls();
    for (int32_t i = 0; i < std::min(capacity, *num_walls); ++i) {
      const PlanWall& wall = open->plan.walls[i];
      const double ends[4] = {wall.start.x(), wall.start.y(), wall.end.x(), wall.end.y()};
      std::copy_n(ends, 4, ends_m + 4 * static_cast<ptrdiff_t>(i));
    }
    return Ok();
  });
}

int32_t cairn_plan_close(cairn_plan* plan) {
  return Call("cairn_plan_close", [&]() -> Status {
    if (plan != nullptr && !OpenPlans().Remove(plan)) return FindPlan(plan).error();
    return Ok();
  });
}
