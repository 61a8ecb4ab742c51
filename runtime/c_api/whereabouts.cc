// The C API's belief over a map's places, image after image, and its atlases of many maps
// (runtime/c_api/cairn.h).
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/atlas/atlas.h"
#include "runtime/atlas/atlas_localizer.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/named_options.h"
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

Handles<cairn_atlas, const Atlas, HandleKind::kAtlas>& OpenAtlases() {
  static auto* atlases = new Handles<cairn_atlas, const Atlas, HandleKind::kAtlas>;
  return *atlases;
}

Result<std::shared_ptr<const Atlas>> FindAtlas(const cairn_atlas* handle) {
  if (auto atlas = OpenAtlases().Find(handle)) return atlas;
  if (handle == nullptr) return Misuse("atlas is NULL");
  return Misuse("the handle is not an atlas: it was closed, or never opened");
}

// Errors: InvalidArgument.
Status CheckMapOf(const Atlas& atlas, int32_t map) {
  if (map >= 0 && map < atlas.num_maps()) return Ok();
  return Misuse("map {} of {}", map, atlas.num_maps());
}

struct OpenAtlasLocalizer : OfOneThread {
  static constexpr const char* kName = "atlas localizer";
  static constexpr const char* kOnePer = "thread";
  std::shared_ptr<const Atlas> atlas;
  AtlasSearchOptions options;
};

Handles<cairn_atlas_localizer, OpenAtlasLocalizer, HandleKind::kAtlasLocalizer>& OpenAtlasLocalizers() {
  static auto* localizers =
      new Handles<cairn_atlas_localizer, OpenAtlasLocalizer, HandleKind::kAtlasLocalizer>;
  return *localizers;
}

// Checks the arrays to which a function writes one entry for each of `capacity` places.
Status CheckPlaceArrays(const char* name, const int32_t* indices, const double* probabilities,
                        int32_t capacity, const int32_t* num_places) {
  if (num_places == nullptr) return Misuse("num_places is NULL");
  if (capacity < 0) return Misuse("capacity is {}; must not be negative", capacity);
  if (capacity > 0 && (indices == nullptr || probabilities == nullptr))
    return Misuse("{} is NULL, with a capacity of {}", indices == nullptr ? name : "probabilities", capacity);
  return Ok();
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

int32_t cairn_place_belief_elapse(cairn_place_belief* belief, double seconds) {
  return Call("cairn_place_belief_elapse", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    return used->belief->Elapse(seconds);
  });
}

int32_t cairn_place_belief_sense_up(cairn_place_belief* belief, double right, double down, double ahead,
                                    double sigma_deg) {
  return Call("cairn_place_belief_sense_up", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenBelief>::Begin(OpenBeliefs(), belief));
    return used->belief->SenseUp({right, down, ahead}, sigma_deg);
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
    CAIRN_RETURN_IF_ERROR(CheckPlaceArrays("images", images, probabilities, capacity, num_places));
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

int32_t cairn_atlas_open(const char* path, const cairn_map_options* options, cairn_atlas** atlas) {
  if (atlas != nullptr) *atlas = nullptr;
  return Call("cairn_atlas_open", [&]() -> Status {
    if (path == nullptr) return Misuse("path is NULL");
    if (atlas == nullptr) return Misuse("atlas is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(const GivenOptions given, OptionsOf(options));
    AtlasOptions atlas_options = {
        .public_key = given.map.public_key, .name = given.map.name, .min_epoch = given.map.min_epoch};
    if (options != nullptr && options->memory_budget_bytes > 0)
      atlas_options.memory_budget_bytes = options->memory_budget_bytes;
    CAIRN_ASSIGN_OR_RETURN(auto open, Atlas::Open(path, atlas_options));
    *atlas = OpenAtlases().Add(std::move(open));
    return Ok();
  });
}

int32_t cairn_atlas_num_maps(const cairn_atlas* atlas, int32_t* num_maps) {
  return Call("cairn_atlas_num_maps", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto open, FindAtlas(atlas));
    if (num_maps == nullptr) return Misuse("num_maps is NULL");
    *num_maps = open->num_maps();
    return Ok();
  });
}

int32_t cairn_atlas_open_map(const cairn_atlas* atlas, int32_t map, cairn_map** opened) {
  if (opened != nullptr) *opened = nullptr;
  return Call("cairn_atlas_open_map", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto open, FindAtlas(atlas));
    if (opened == nullptr) return Misuse("opened is NULL: there is no place for the handle");
    CAIRN_RETURN_IF_ERROR(CheckMapOf(*open, map));
    CAIRN_ASSIGN_OR_RETURN(auto of_atlas, open->OpenMap(map));
    *opened = OpenMaps().Add(std::move(of_atlas));
    return Ok();
  });
}

int32_t cairn_atlas_close(cairn_atlas* atlas) {
  return Call("cairn_atlas_close", [&]() -> Status {
    if (atlas != nullptr && !OpenAtlases().Remove(atlas)) return FindAtlas(atlas).error();
    return Ok();
  });
}

int32_t cairn_atlas_localizer_create(const cairn_atlas* atlas, cairn_atlas_localizer** localizer) {
  if (localizer != nullptr) *localizer = nullptr;
  return Call("cairn_atlas_localizer_create", [&]() -> Status {
    if (localizer == nullptr) return Misuse("localizer is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenAtlasLocalizer>();
    CAIRN_ASSIGN_OR_RETURN(created->atlas, FindAtlas(atlas));
    *localizer = OpenAtlasLocalizers().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_atlas_localizer_set_option(cairn_atlas_localizer* localizer, const char* name,
                                         const char* value) {
  return Call("cairn_atlas_localizer_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenAtlasLocalizer>::Begin(OpenAtlasLocalizers(), localizer));
    return SetOptionByName(DescribeOptions(&used->options), name, value);
  });
}

int32_t cairn_atlas_localize(cairn_atlas_localizer* localizer, const cairn_image* image,
                             const cairn_camera* camera, int32_t* maps, double* probabilities,
                             int32_t capacity, int32_t* num_places, double* elsewhere, cairn_fix* fix) {
  if (num_places != nullptr) *num_places = 0;
  return Call("cairn_atlas_localize", [&]() -> Status {
    if (fix != nullptr) {
      CAIRN_RETURN_IF_ERROR(CheckFix(fix));
      Return(FixFrom({}), fix);
    }
    CAIRN_RETURN_IF_ERROR(CheckPlaceArrays("maps", maps, probabilities, capacity, num_places));
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenAtlasLocalizer>::Begin(OpenAtlasLocalizers(), localizer));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Camera> given, GivenCameraOf(camera));
    AtlasLocalizer search(used->atlas, used->options.localizer, used->options.atlas);
    CAIRN_ASSIGN_OR_RETURN(const AtlasAnswer answer, search.Localize(grey, given));
    for (const AtlasHypothesis& hypothesis : answer.hypotheses) {
      if (*num_places == capacity) break;
      maps[*num_places] = hypothesis.map;
      probabilities[*num_places] = hypothesis.probability;
      ++*num_places;
    }
    if (elsewhere != nullptr) *elsewhere = answer.elsewhere;
    if (fix == nullptr) return Ok();
    Localization best = answer.hypotheses.empty() ? answer.best_failure : answer.hypotheses[0].found;
    if (!answer.hypotheses.empty()) best.probability = answer.hypotheses[0].probability;
    Return(FixFrom(best), fix);
    return Ok();
  });
}

int32_t cairn_atlas_localizer_destroy(cairn_atlas_localizer* localizer) {
  return Call("cairn_atlas_localizer_destroy",
              [&] { return DestroyObject(OpenAtlasLocalizers(), localizer); });
}
