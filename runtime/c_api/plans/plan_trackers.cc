// The C API's plan trackers (runtime/c_api/cairn.h): a robot on a floor plan, by laser, wheels and camera.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/belief/robot_on_plan.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/named_options.h"
#include "runtime/c_api/plans/plans.h"
#include "runtime/c_api/structs.h"

namespace cairn {
namespace {

struct OpenPlanTracker : OfOneThread {
  static constexpr const char* kName = "plan tracker";
  static constexpr const char* kOnePer = "robot";
  std::shared_ptr<const Views> plan;
  RobotOnPlanOptions options;
  std::optional<RobotOnPlan> robot;
  std::vector<PossiblePlace> places;  // the robot's, now

  // After an error it is as before.
  Status Begin(const RobotOnPlanOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(robot, RobotOnPlan::Make(plan, given));
    options = given;
    places = robot->Places();
    return Ok();
  }
};

Handles<cairn_plan_tracker, OpenPlanTracker, HandleKind::kPlanTracker>& OpenPlanTrackers() {
  static auto* trackers = new Handles<cairn_plan_tracker, OpenPlanTracker, HandleKind::kPlanTracker>;
  return *trackers;
}

// Runs `change` on a tracker's robot, and keeps what is believed then.
template <typename Change>
int32_t CallChange(const char* function, cairn_plan_tracker* tracker, Change&& change) {
  return Call(function, [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlanTracker>::Begin(OpenPlanTrackers(), tracker));
    CAIRN_RETURN_IF_ERROR(change(*used->robot));
    used->places = used->robot->Places();
    return Ok();
  });
}

// Errors: InvalidArgument (a struct of an earlier release, which has no probability; no pose).
Result<Localization> LocalizationOf(const cairn_fix* given) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "fix", offsetof(cairn_fix, work_ms)));
  Localization found;
  if (given->has_fix == 0) return found;
  cairn_uncertain_pose pose = CAIRN_UNCERTAIN_POSE_INIT;
  std::copy_n(given->rotation_wxyz, 4, pose.rotation_wxyz);
  std::copy_n(given->translation_m, 3, pose.translation_m);
  std::copy_n(given->covariance, 36, pose.covariance);
  CAIRN_ASSIGN_OR_RETURN(const UncertainPose known, UncertainPoseOf(&pose));
  if (!(given->probability >= 0 && given->probability <= 1))
    return Misuse("fix->probability is {}; expected 0 to 1", given->probability);
  found.reason = NoFix::kNone;
  found.cam_from_world = known.pose;
  found.covariance = known.covariance;
  found.probability = given->probability;
  return found;
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_plan_tracker_create(const cairn_plan* plan, cairn_plan_tracker** tracker) {
  if (tracker != nullptr) *tracker = nullptr;
  return Call("cairn_plan_tracker_create", [&]() -> Status {
    if (tracker == nullptr) return Misuse("tracker is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenPlanTracker>();
    CAIRN_ASSIGN_OR_RETURN(created->plan, FindPlan(plan));
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *tracker = OpenPlanTrackers().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_plan_tracker_set_option(cairn_plan_tracker* tracker, const char* name, const char* value) {
  return Call("cairn_plan_tracker_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlanTracker>::Begin(OpenPlanTrackers(), tracker));
    RobotOnPlanOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kPlanTrackerOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_plan_tracker_move(cairn_plan_tracker* tracker, double ahead_m, double left_m,
                                double turn_left_rad) {
  return CallChange("cairn_plan_tracker_move", tracker, [&](RobotOnPlan& robot) {
    return robot.Move({{ahead_m, left_m}, turn_left_rad});
  });
}

int32_t cairn_plan_tracker_move_to(cairn_plan_tracker* tracker, double x_m, double y_m, double heading_rad) {
  return CallChange("cairn_plan_tracker_move_to", tracker, [&](RobotOnPlan& robot) {
    return robot.MoveTo({{x_m, y_m}, heading_rad});
  });
}

int32_t cairn_plan_tracker_see_scan(cairn_plan_tracker* tracker, const cairn_scan* scan) {
  return CallChange("cairn_plan_tracker_see_scan", tracker, [&](RobotOnPlan& robot) -> Status {
    CAIRN_ASSIGN_OR_RETURN(const RangeScan given, RangeScanOf(scan));
    return robot.SeeScan(given);
  });
}

int32_t cairn_plan_tracker_see_image(cairn_plan_tracker* tracker, cairn_localizer* localizer,
                                     const cairn_image* image, const cairn_camera* camera, cairn_fix* fix) {
  return CallChange("cairn_plan_tracker_see_image", tracker, [&](RobotOnPlan& robot) -> Status {
    if (fix != nullptr) {
      CAIRN_RETURN_IF_ERROR(CheckFix(fix));
      Return(FixFrom({}), fix);
    }
    CAIRN_ASSIGN_OR_RETURN(const LocalizedImage seen, LocalizeAlone(localizer, image, camera));
    CAIRN_RETURN_IF_ERROR(robot.SeeImage(seen.found, seen.map->head()));
    if (fix != nullptr) Return(FixFrom(seen.found), fix);
    return Ok();
  });
}

int32_t cairn_plan_tracker_see_fix(cairn_plan_tracker* tracker, const cairn_map* map, const cairn_fix* fix) {
  return CallChange("cairn_plan_tracker_see_fix", tracker, [&](RobotOnPlan& robot) -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> of_fix, FindMap(map));
    CAIRN_ASSIGN_OR_RETURN(const Localization found, LocalizationOf(fix));
    return robot.SeeImage(found, of_fix->head());
  });
}

int32_t cairn_plan_tracker_see_places(cairn_plan_tracker* tracker, const cairn_plan_place* const* places,
                                      int32_t num_places) {
  return CallChange("cairn_plan_tracker_see_places", tracker, [&](RobotOnPlan& robot) -> Status {
    constexpr int32_t kMaxNumPlaces = 1000;
    if (num_places < 0 || num_places > kMaxNumPlaces)
      return Misuse("num_places is {}; expected 0 to {}", num_places, kMaxNumPlaces);
    if (places == nullptr && num_places > 0) return Misuse("places is NULL, and num_places {}", num_places);
    std::vector<PossiblePlace> seen;
    for (int32_t i = 0; i < num_places; ++i) {
      CAIRN_ASSIGN_OR_RETURN(const PossiblePlace place, PossiblePlaceOf(places[i]));
      seen.push_back(place);
    }
    return robot.SeePlaces(seen);
  });
}

int32_t cairn_plan_tracker_places(const cairn_plan_tracker* tracker, int32_t* num_places, double* elsewhere) {
  if (num_places != nullptr) *num_places = 0;
  return Call("cairn_plan_tracker_places", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlanTracker>::Begin(OpenPlanTrackers(), tracker));
    if (num_places == nullptr) return Misuse("num_places is NULL");
    *num_places = static_cast<int32_t>(used->places.size());
    if (elsewhere != nullptr) *elsewhere = used->robot->elsewhere();
    return Ok();
  });
}

int32_t cairn_plan_tracker_place(const cairn_plan_tracker* tracker, int32_t number, cairn_plan_place* place) {
  return Call("cairn_plan_tracker_place", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckStruct(place, "place"));
    Return(cairn_plan_place CAIRN_PLAN_PLACE_INIT, place);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlanTracker>::Begin(OpenPlanTrackers(), tracker));
    if (number < 0 || number >= static_cast<int32_t>(used->places.size()))
      return Misuse("place {} of {}", number, used->places.size());
    const PossiblePlace& believed = used->places[number];
    Return(PlanPlaceFrom(believed, IsDetermined(believed.covariance)), place);
    return Ok();
  });
}

int32_t cairn_plan_tracker_destroy(cairn_plan_tracker* tracker) {
  return Call("cairn_plan_tracker_destroy", [&] { return DestroyObject(OpenPlanTrackers(), tracker); });
}
