// The C API (runtime/c_api/cairn.h) over the C++ one: versions and names, maps, localizers.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "core/features/features.h"
#include "core/seal/accept_key_ring.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/calls.h"
#include "runtime/c_api/logs.h"
#include "runtime/c_api/structs.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/update_map.h"
#include "runtime/visual_map/visual_estimate.h"
#include "runtime/visual_map/visual_map.h"

namespace cairn {
namespace {

static_assert(CAIRN_OTHER_MAP == static_cast<int>(ErrorCode::kOtherMap));
static_assert(CAIRN_NO_MEMORY == static_cast<int>(ErrorCode::kNoMemory));

struct OpenLocalizer : OfOneThread {
  static constexpr const char* kName = "localizer";
  static constexpr const char* kOnePer = "thread";
  std::shared_ptr<const Map> map;
  std::unique_ptr<Localizer> localizer;
  std::shared_ptr<const VisualMap> visual;  // once it was asked for
  std::shared_ptr<SharedLog> log;           // where it has one
  std::optional<SensedUp> up;               // of the next image
};

Handles<cairn_localizer, OpenLocalizer, HandleKind::kLocalizer>& OpenLocalizers() {
  static auto* localizers = new Handles<cairn_localizer, OpenLocalizer, HandleKind::kLocalizer>;
  return *localizers;
}

Result<LocalizedImage> LocalizeImage(cairn_localizer* localizer, const cairn_image* image,
                                     const cairn_camera* camera, const cairn_prior* prior) {
  CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
  const auto up = std::exchange(used->up, std::nullopt);  // of this image, whatever comes
  CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
  CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
  CAIRN_ASSIGN_OR_RETURN(const std::optional<PosePrior> believed, PriorOf(prior));
  QueryFrame frame(*used->localizer, grey, chosen);
  if (up) frame.set_up(*up);
  CAIRN_ASSIGN_OR_RETURN(const Query* query, frame.WithAllFeatures());
  CAIRN_ASSIGN_OR_RETURN(Localization found, used->localizer->LocalizeQuery(*query, believed));
  if (used->log) used->log->Offer(&frame, found);
  return LocalizedImage{std::move(found), used->map};
}

}  // namespace

Result<LocalizedImage> LocalizeAlone(cairn_localizer* localizer, const cairn_image* image,
                                     const cairn_camera* camera) {
  return LocalizeImage(localizer, image, camera, nullptr);
}

}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

const char* cairn_version(void) { return CAIRN_VERSION; }

const char* cairn_error_name(int32_t code) {
  if (code == CAIRN_OK) return "ok";
  return code < CAIRN_OK || code > CAIRN_NO_MEMORY ? "unknown" : ErrorCodeName(static_cast<ErrorCode>(code));
}

const char* cairn_reason_name(int32_t reason) {
  return reason < CAIRN_FIX || reason > CAIRN_OVER_BUDGET ? "unknown" : NoFixName(static_cast<NoFix>(reason));
}

const char* cairn_scope_name(int32_t scope) {
  return scope < CAIRN_SCOPE_PRIOR || scope > CAIRN_SCOPE_VOTES ? "unknown"
                                                                : ScopeName(static_cast<Scope>(scope));
}

const char* cairn_last_error(void) { return LastError(); }

int32_t cairn_map_update(const char* map_path, const char* delta_path, const cairn_map_options* options,
                         int32_t* was_updated) {
  if (was_updated != nullptr) *was_updated = 0;
  return Call("cairn_map_update", [&]() -> Status {
    if (map_path == nullptr || delta_path == nullptr)
      return Misuse("{} is NULL", map_path == nullptr ? "map_path" : "delta_path");
    CAIRN_ASSIGN_OR_RETURN(const GivenOptions given, OptionsOf(options));
    CAIRN_ASSIGN_OR_RETURN(const bool updated, UpdateMap(map_path, delta_path, given.update));
    if (was_updated != nullptr) *was_updated = updated ? 1 : 0;
    return Ok();
  });
}

int32_t cairn_map_roll_back(const char* map_path, const cairn_map_options* options) {
  return Call("cairn_map_roll_back", [&]() -> Status {
    if (map_path == nullptr) return Misuse("map_path is NULL");
    CAIRN_ASSIGN_OR_RETURN(const GivenOptions given, OptionsOf(options));
    return RollBackMap(map_path, given.update);
  });
}

int32_t cairn_key_ring_accept(const char* ring_path, const char* next_path, uint64_t* version) {
  return Call("cairn_key_ring_accept", [&]() -> Status {
    if (ring_path == nullptr || next_path == nullptr) return Misuse("ring_path or next_path is NULL");
    CAIRN_ASSIGN_OR_RETURN(const KeyRing ring, AcceptKeyRings(ring_path, {next_path}));
    if (version != nullptr) *version = ring.version;
    return Ok();
  });
}

int32_t cairn_map_open(const char* path, const cairn_map_options* options, cairn_map** map) {
  if (map != nullptr) *map = nullptr;
  return Call("cairn_map_open", [&]() -> Status {
    if (path == nullptr) return Misuse("path is NULL");
    if (map == nullptr) return Misuse("map is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(const GivenOptions given, OptionsOf(options));
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Map> open, Map::Open(path, given.map));
    *map = OpenMaps().Add(std::move(open));
    return Ok();
  });
}

int32_t cairn_map_describe(const cairn_map* map, cairn_map_description* description) {
  return Call("cairn_map_describe", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    CAIRN_RETURN_IF_ERROR(CheckStruct(description, "description", offsetof(cairn_map_description, epoch)));
    cairn_map_description said = CAIRN_MAP_DESCRIPTION_INIT;
    said.num_landmarks = open->num_landmarks();
    said.num_images = open->num_images();
    said.num_regions = open->num_regions();
    said.has_visual_map = open->has_visual_map();
    said.is_metric = IsMetric(open->head().frame);
    CopyText(open->head().name, said.name);
    said.epoch = open->head().epoch;
    said.scale_sigma_ratio = open->head().frame.scale_sigma_ratio;
    for (int i = 0; i < 3; ++i) said.scale_centre_m[i] = open->head().frame.scale_centre[i];
    Return(said, description);
    return Ok();
  });
}

int32_t cairn_map_camera_for_size(const cairn_map* map, int32_t width, int32_t height, cairn_camera* camera) {
  return Call("cairn_map_camera_for_size", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const std::shared_ptr<const Map> open, FindMap(map));
    CAIRN_RETURN_IF_ERROR(CheckStruct(camera, "camera"));
    CAIRN_ASSIGN_OR_RETURN(const Camera found, open->CameraForSize(width, height));
    cairn_camera given = CAIRN_CAMERA_INIT;
    given.model = static_cast<int32_t>(found.model);
    given.width = found.width;
    given.height = found.height;
    given.num_params = static_cast<int32_t>(found.params.size());
    std::copy(found.params.begin(), found.params.end(), given.params);
    Return(given, camera);
    return Ok();
  });
}

int32_t cairn_map_close(cairn_map* map) {
  return Call("cairn_map_close", [&]() -> Status {
    if (map != nullptr && !OpenMaps().Remove(map)) return FindMap(map).error();
    return Ok();
  });
}

int32_t cairn_localizer_create(const cairn_map* map, cairn_localizer** localizer) {
  if (localizer != nullptr) *localizer = nullptr;
  return Call("cairn_localizer_create", [&]() -> Status {
    if (localizer == nullptr) return Misuse("localizer is NULL: there is no place for the handle");
    auto created = std::make_shared<OpenLocalizer>();
    CAIRN_ASSIGN_OR_RETURN(created->map, FindMap(map));
    created->localizer = std::make_unique<Localizer>(created->map);
    *localizer = OpenLocalizers().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_localizer_set_option(cairn_localizer* localizer, const char* name, const char* value) {
  return Call("cairn_localizer_set_option", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    LocalizerOptions options = used->localizer->options();
    CAIRN_RETURN_IF_ERROR(SetOptionByName(DescribeOptions(&options), name, value));
    used->localizer = std::make_unique<Localizer>(used->map, options);
    return Ok();
  });
}

int32_t cairn_localizer_set_log(cairn_localizer* localizer, const cairn_log* log) {
  return Call("cairn_localizer_set_log", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    CAIRN_ASSIGN_OR_RETURN(used->log, LogFor(log, *used->map));
    return Ok();
  });
}

int32_t cairn_localizer_destroy(cairn_localizer* localizer) {
  return Call("cairn_localizer_destroy",
              [&]() -> Status { return DestroyObject(OpenLocalizers(), localizer); });
}

int32_t cairn_localize(cairn_localizer* localizer, const cairn_image* image, const cairn_camera* camera,
                       const cairn_prior* prior, cairn_fix* fix) {
  return Call("cairn_localize", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(FixFrom({}), fix);  // after an error the caller must not find the previous fix
    CAIRN_ASSIGN_OR_RETURN(const LocalizedImage seen, LocalizeImage(localizer, image, camera, prior));
    Return(FixFrom(seen.found), fix);
    return Ok();
  });
}

int32_t cairn_localize_features(cairn_localizer* localizer, const float* keypoints, const void* descriptors,
                                int32_t is_float, int32_t num_columns, int32_t num_features,
                                const cairn_camera* camera, const cairn_prior* prior, cairn_fix* fix) {
  return Call("cairn_localize_features", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(FixFrom({}), fix);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    const auto up = std::exchange(used->up, std::nullopt);
    if (num_features < 0 || num_columns < 0)
      return Misuse("{} features of {} values each", num_features, num_columns);
    if (num_features > 0 && (keypoints == nullptr || descriptors == nullptr))
      return Misuse("{} is NULL", keypoints == nullptr ? "keypoints" : "descriptors");
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Camera> chosen, GivenCameraOf(camera));
    if (!chosen) return Misuse("camera is NULL: features do not say how large their image is");
    CAIRN_ASSIGN_OR_RETURN(const std::optional<PosePrior> believed, PriorOf(prior));
    const DescriptorKind& kind = used->map->head().descriptor_kind;
    Features features{.keypoints = {}, .descriptors = DescriptorMatrix(0, kind.num_values), .kind = kind};
    for (int32_t i = 0; i < num_features; ++i) {
      const float* k = keypoints + 4 * static_cast<ptrdiff_t>(i);
      if (!std::all_of(k, k + 4, [](float value) { return std::isfinite(value); }))
        return Misuse("keypoint {} is not finite", i);
      features.keypoints.push_back({k[0], k[1], k[2], k[3]});
    }
    if (num_features > 0 && is_float != 0) {
      CAIRN_ASSIGN_OR_RETURN(
          features.descriptors,
          DescriptorsFromFloats(Eigen::Map<const FloatDescriptors>(static_cast<const float*>(descriptors),
                                                                   num_features, num_columns),
                                kind));
    } else if (num_features > 0) {
      CAIRN_ASSIGN_OR_RETURN(
          features.descriptors,
          DescriptorsFromBytes(static_cast<const uint8_t*>(descriptors), num_features, num_columns, kind));
    }
    CAIRN_ASSIGN_OR_RETURN(const Localization found,
                           used->localizer->LocalizeFeatures(std::move(features), *chosen, believed, up));
    Return(FixFrom(found), fix);
    return Ok();
  });
}

int32_t cairn_map_descriptors(const cairn_map* map, char* text, int32_t capacity) {
  return Call("cairn_map_descriptors", [&]() -> Status {
    if (text == nullptr || capacity < 1) return Misuse("there is no place for the text");
    text[0] = '\0';
    CAIRN_ASSIGN_OR_RETURN(const auto open, FindMap(map));
    const std::string kind = ToString(open->head().descriptor_kind);
    const size_t num = std::min(kind.size(), static_cast<size_t>(capacity) - 1);
    kind.copy(text, num);
    text[num] = '\0';
    return Ok();
  });
}

int32_t cairn_localizer_sense_up(cairn_localizer* localizer, double right, double down, double ahead,
                                 double sigma_deg) {
  return Call("cairn_localizer_sense_up", [&]() -> Status {
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    const SensedUp up{{right, down, ahead}, sigma_deg};
    CAIRN_RETURN_IF_ERROR(CheckSensedUp(up));
    used->up = up;
    return Ok();
  });
}

int32_t cairn_localize_rig(cairn_localizer* localizer, const cairn_rig_image* const* images,
                           int32_t num_images, const cairn_prior* prior, cairn_fix* fix) {
  return Call("cairn_localize_rig", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(FixFrom({}), fix);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    const auto up = std::exchange(used->up, std::nullopt);  // of this image, whatever comes
    CAIRN_ASSIGN_OR_RETURN(const std::vector<RigImage> rig, RigImagesOf(images, num_images, *used->map));
    CAIRN_ASSIGN_OR_RETURN(const std::optional<PosePrior> believed, PriorOf(prior));
    CAIRN_ASSIGN_OR_RETURN(const Localization found, used->localizer->LocalizeRig(rig, believed, up));
    Return(FixFrom(found), fix);
    return Ok();
  });
}

int32_t cairn_localize_on_floor(cairn_localizer* localizer, const cairn_image* image,
                                const cairn_camera* camera, cairn_floor_fix* fix) {
  return Call("cairn_localize_on_floor", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFix(fix));
    Return(cairn_floor_fix CAIRN_FLOOR_FIX_INIT, fix);
    CAIRN_ASSIGN_OR_RETURN(const auto used, Use<OpenLocalizer>::Begin(OpenLocalizers(), localizer));
    used->up.reset();  // it was of this image
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    if (!used->visual) {
      CAIRN_ASSIGN_OR_RETURN(used->visual, VisualMap::Open(used->map));
    }
    CAIRN_ASSIGN_OR_RETURN(const Query query, used->localizer->QueryFromImage(grey, chosen));
    CAIRN_ASSIGN_OR_RETURN(const auto seen, used->visual->Match(query));
    CAIRN_ASSIGN_OR_RETURN(const VisualPose found, EstimateVisualPose(*used->visual, seen));
    Return(FloorFixFrom(found, Scope::kAll), fix);
    return Ok();
  });
}
