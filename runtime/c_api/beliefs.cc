// The C API's belief over places, image after image (runtime/c_api/cairn.h).
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/place_options.h"
#include "runtime/c_api/structs.h"
#include "runtime/drive/place_belief.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"

namespace cairn {
namespace {

struct OpenBelief : OfOneThread {
  static constexpr const char* kName = "place belief";
  static constexpr const char* kOnePer = "robot";
  std::shared_ptr<const Map> map;
  BeliefOptions options;
  std::optional<Localizer> localizer;
  std::optional<PlaceBelief> belief;

  // After an error it is as before.
  Status Begin(const BeliefOptions& given) {
    CAIRN_ASSIGN_OR_RETURN(belief, PlaceBelief::Make(map, given.belief));
    options = given;
    localizer.emplace(map, options.localizer);
    return Ok();
  }
};

Handles<cairn_place_belief, OpenBelief, HandleKind::kPlaceBelief>& OpenBeliefs() {
  static auto* beliefs = new Handles<cairn_place_belief, OpenBelief, HandleKind::kPlaceBelief>;
  return *beliefs;
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

int32_t cairn_place_belief_create(const cairn_map* map, cairn_place_belief** belief) {
  if (belief != nullptr) *belief = nullptr;
  return Call("cairn_place_belief_create", [&]() -> Status {
    if (belief == nullptr) return Misuse("belief is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenBelief>();
    CAIRN_ASSIGN_OR_RETURN(created->map, FindMap(map));
    CAIRN_RETURN_IF_ERROR(created->Begin({}));
    *belief = OpenBeliefs().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_place_belief_set_option(cairn_place_belief* belief, const char* name, const char* value) {
  return Call("cairn_place_belief_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    BeliefOptions options = used->options;
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value, kBeliefOptionsHelp));
    return used->Begin(options);
  });
}

int32_t cairn_place_belief_move(cairn_place_belief* belief, double ahead_m, double left_m,
                                double turn_left_rad) {
  return Call("cairn_place_belief_move", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    return used->belief->Move({ahead_m, left_m}, turn_left_rad);
  });
}

int32_t cairn_place_belief_see(cairn_place_belief* belief, const cairn_image* image,
                               const cairn_camera* camera, cairn_fix* fix) {
  return Call("cairn_place_belief_see", [&]() -> Status {
    if (fix != nullptr) {
      CAIRN_RETURN_IF_ERROR(CheckFix(fix));
      Return(FixFrom({}), fix);
    }
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    CAIRN_ASSIGN_OR_RETURN(const Query query, used->localizer->QueryFromImage(grey, chosen));
    CAIRN_ASSIGN_OR_RETURN(const Localization found, used->localizer->LocalizeQuery(query, std::nullopt));
    CAIRN_RETURN_IF_ERROR(used->belief->See(query, found));
    if (fix != nullptr) Return(FixFrom(found), fix);
    return Ok();
  });
}

int32_t cairn_place_belief_places(const cairn_place_belief* belief, int32_t* images, double* probabilities,
                                  int32_t capacity, int32_t* num_places, double* elsewhere) {
  if (num_places != nullptr) *num_places = 0;
  return Call("cairn_place_belief_places", [&]() -> Status {
    if (num_places == nullptr) return Misuse("num_places is NULL");
    if (capacity < 0) return Misuse("capacity is {}; must not be negative", capacity);
    if (capacity > 0 && (images == nullptr || probabilities == nullptr))
      return Misuse("{} is NULL, with a capacity of {}", images == nullptr ? "images" : "probabilities",
                    capacity);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    CAIRN_ASSIGN_OR_RETURN(const std::vector<PlaceHypothesis> places, used->belief->Hypotheses(capacity));
    for (size_t i = 0; i < places.size(); ++i) {
      images[i] = places[i].image;
      probabilities[i] = places[i].probability;
    }
    *num_places = static_cast<int32_t>(places.size());
    if (elsewhere != nullptr) *elsewhere = used->belief->elsewhere();
    return Ok();
  });
}

int32_t cairn_place_belief_destroy(cairn_place_belief* belief) {
  return Call("cairn_place_belief_destroy", [&] { return DestroyObject(OpenBeliefs(), belief); });
}
