// The C API's starts of a robot that does not know where it was switched on (runtime/c_api/cairn.h).
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/places.h"
#include "runtime/drive/start_hypotheses.h"

namespace cairn {
namespace {

static_assert(CAIRN_VERDICT_LOST == static_cast<int>(HypothesisVerdict::kLost));

struct OpenStarts : OfOneThread {
  static constexpr const char* kName = "set of starts";
  static constexpr const char* kOnePer = "robot";
  PlaceModel model;
  PlaceScores first;
  NodeIdx goal = 0;
  StartHypothesesOptions options;
  std::optional<StartHypotheses> starts;

  OpenStarts(const PlaceModel& of, PlaceScores scores, NodeIdx goal_place)
      : model(of), first(std::move(scores)), goal(goal_place) {}
  // After an error it is as before.
  Status Begin(const StartHypothesesOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(starts, StartHypotheses::Make(model, first, goal, given));
    options = given;
    return Ok();
  }
};

Handles<cairn_start_hypotheses, OpenStarts, HandleKind::kStartHypotheses>& AllStarts() {
  static auto* starts = new Handles<cairn_start_hypotheses, OpenStarts, HandleKind::kStartHypotheses>;
  return *starts;
}

// The caller's scores, or its probabilities.
Result<PlaceScores> ScoresOf(const cairn_place_scores* given, const char* name, bool are_probabilities,
                             const PlaceModel& model) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, name));
  const double* numbers = are_probabilities ? given->probabilities : given->scores;
  if (numbers == nullptr)
    return Misuse("{}->{} is NULL", name, are_probabilities ? "probabilities" : "scores");
  if (given->num_places != model.num_nodes())
    return Misuse("{}->num_places is {}, but the map has {}", name, given->num_places, model.num_nodes());
  PlaceScores places;
  (are_probabilities ? places.probabilities : places.scores).assign(numbers, numbers + given->num_places);
  CAIRN_RETURN_IF_ERROR(CheckPlaceScores(places, model.num_nodes()));
  return places;
}

Status CheckNumber(const StartHypotheses& starts, int32_t number) {
  if (number >= 0 && number < static_cast<int32_t>(starts.hypotheses().size())) return Ok();
  return Misuse("start {} of {}", number, starts.hypotheses().size());
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

const char* cairn_verdict_name(int32_t verdict) {
  return verdict < CAIRN_VERDICT_FOLLOW || verdict > CAIRN_VERDICT_LOST
             ? "unknown"
             : VerdictName(static_cast<HypothesisVerdict>(verdict));
}

int32_t cairn_start_hypotheses_create(const cairn_place_model* model, const cairn_place_scores* first,
                                      int32_t goal_place, cairn_start_hypotheses** starts) {
  if (starts != nullptr) *starts = nullptr;
  return Call("cairn_start_hypotheses_create", [&]() -> Status {
    if (starts == nullptr) return Misuse("starts is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenPlaceModel>::Begin(OpenPlaceModels(), model));
    CAIRN_ASSIGN_OR_RETURN(PlaceScores scores, ScoresOf(first, "first", false, *used->model));
    auto created = std::make_shared<OpenStarts>(*used->model, std::move(scores), goal_place);
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *starts = AllStarts().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_start_hypotheses_set_option(cairn_start_hypotheses* starts, const char* name,
                                          const char* value) {
  return Call("cairn_start_hypotheses_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    StartHypothesesOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kStartOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_start_hypotheses_observe(cairn_start_hypotheses* starts, const cairn_place_scores* places,
                                       int32_t* verdict) {
  return Call("cairn_start_hypotheses_observe", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    if (verdict == nullptr) return Misuse("verdict is NULL");
    CAIRN_ASSIGN_OR_RETURN(const PlaceScores seen, ScoresOf(places, "places", true, used->model));
    *verdict = static_cast<int32_t>(used->starts->Observe(seen));
    return Ok();
  });
}

int32_t cairn_start_hypotheses_refute(cairn_start_hypotheses* starts, int32_t* is_other) {
  return Call("cairn_start_hypotheses_refute", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    if (is_other == nullptr) return Misuse("is_other is NULL");
    *is_other = used->starts->Refute() ? 1 : 0;
    return Ok();
  });
}

int32_t cairn_start_hypotheses_restart(cairn_start_hypotheses* starts) {
  return Call("cairn_start_hypotheses_restart", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    used->starts->Restart();
    return Ok();
  });
}

int32_t cairn_start_hypotheses_count(const cairn_start_hypotheses* starts, int32_t* num_starts) {
  return Call("cairn_start_hypotheses_count", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    if (num_starts == nullptr) return Misuse("num_starts is NULL");
    *num_starts = static_cast<int32_t>(used->starts->hypotheses().size());
    return Ok();
  });
}

int32_t cairn_start_hypotheses_get(const cairn_start_hypotheses* starts, int32_t number,
                                   cairn_start_hypothesis* start) {
  return Call("cairn_start_hypotheses_get", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    CAIRN_RETURN_IF_ERROR(CheckStruct(start, "start"));
    CAIRN_RETURN_IF_ERROR(CheckNumber(*used->starts, number));
    const StartHypothesis& found = used->starts->hypotheses()[number];
    cairn_start_hypothesis given = CAIRN_START_HYPOTHESIS_INIT;
    given.start = found.start;
    given.whereabouts = used->starts->Whereabouts(number);
    given.num_way_places = static_cast<int32_t>(found.path.nodes.size());
    given.is_followed = number == used->starts->followed() ? 1 : 0;
    given.score = found.score;
    given.posterior = found.posterior;
    given.way_cost = found.path.cost;
    Return(given, start);
    return Ok();
  });
}

int32_t cairn_start_hypotheses_way(const cairn_start_hypotheses* starts, int32_t number,
                                   int32_t from_whereabouts, int32_t* places, int32_t capacity,
                                   int32_t* num_places) {
  if (num_places != nullptr) *num_places = 0;
  return Call("cairn_start_hypotheses_way", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenStarts>::Begin(AllStarts(), starts));
    CAIRN_RETURN_IF_ERROR(CheckNumber(*used->starts, number));
    if (from_whereabouts != 0 && from_whereabouts != 1)
      return Misuse("from_whereabouts is {}; expected 0 or 1", from_whereabouts);
    if (from_whereabouts == 0)
      return ReturnNumbers(used->starts->hypotheses()[number].path.nodes, "places", places, capacity,
                           num_places);
    const std::optional<NodePath> path = used->starts->Replan(number);
    if (!path)
      return MakeError(ErrorCode::kNotFound, "no way over kept images leads from place {} to the goal",
                       used->starts->Whereabouts(number));
    return ReturnNumbers(path->nodes, "places", places, capacity, num_places);
  });
}

int32_t cairn_start_hypotheses_destroy(cairn_start_hypotheses* starts) {
  return Call("cairn_start_hypotheses_destroy", [&] { return DestroyObject(AllStarts(), starts); });
}
