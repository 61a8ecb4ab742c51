// The C API (runtime/c_api/cairn.h) over the C++ one: handles looked up, structs checked and converted,
// errors kept per thread.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "core/base/no_throw.h"
#include "core/options/find_option.h"
#include "runtime/c_api/cairn.h"
#include "runtime/c_api/handles.h"
#include "runtime/localize/localizer.h"
#include "runtime/localize/measurement.h"
#include "runtime/map/update_map.h"
#include "runtime/visual_map/visual_estimate.h"
#include "runtime/visual_map/visual_map.h"

namespace cairn {
namespace {

static_assert(CAIRN_OTHER_MAP == static_cast<int>(ErrorCode::kOtherMap));
static_assert(CAIRN_AMBIGUOUS == static_cast<int>(NoFix::kAmbiguous));

struct OpenLocalizer {
  std::shared_ptr<const Map> map;
  std::unique_ptr<Localizer> localizer;
  std::shared_ptr<const VisualMap> visual;  // once it was asked for
  std::atomic<bool> is_in_use = false;
};

Handles<cairn_map, const Map, 1, 2>& Maps() {
  static auto* maps = new Handles<cairn_map, const Map, 1, 2>;  // outlives what other libraries do at exit
  return *maps;
}

Handles<cairn_localizer, OpenLocalizer, 2, 2>& Localizers() {
  static auto* localizers = new Handles<cairn_localizer, OpenLocalizer, 2, 2>;
  return *localizers;
}

std::string& LastError() {
  thread_local std::string message;
  return message;
}

// Runs a function's body; its error becomes the code, its sentence this thread's last one.
template <typename Body>
int32_t Call(const char* function, Body&& body) {
  const Status status = WithoutExceptions(function, [&]() -> Status { return body(); });
  if (status.ok()) return CAIRN_OK;
  const std::string& message = status.error().message;
  LastError() = message.starts_with(function) ? message : std::string(function) + ": " + message;
  return static_cast<int32_t>(status.error().code);
}

template <typename... Args>
Error Misuse(fmt::format_string<Args...> format, Args&&... args) {
  return MakeError(ErrorCode::kInvalidArgument, format, std::forward<Args>(args)...);
}

// Checks that a struct is given and at least as long as the first release's, `least`: later ones only grow.
template <typename Struct>
Status CheckStruct(const Struct* value, const char* name, size_t least = sizeof(Struct)) {
  if (value == nullptr) return Misuse("{} is NULL", name);
  if (value->size < least)
    return Misuse("{}->size is {}, expected at least {}: set it to sizeof *{} before the call", name,
                  value->size, least, name);
  return Ok();
}

// Copies as much of a result as the caller has room for; its size field stays.
template <typename Struct>
void Return(Struct result, Struct* to) {
  result.size = to->size;
  std::memcpy(to, &result, std::min(to->size, sizeof(Struct)));
}

// Cuts a text where a UTF-8 character begins.
template <size_t kNumBytes>
void CopyText(const std::string& text, char (&to)[kNumBytes]) {
  size_t length = std::min(text.size(), kNumBytes - 1);
  if (length < text.size()) {
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80) --length;
  }
  std::memcpy(to, text.data(), length);
  to[length] = 0;
}

// What the caller requires of a map that is opened or that an update brings.
struct GivenOptions {
  MapOptions map;
  UpdateOptions update;
};

// The caller's options; NULL: the defaults.  Callers built with an earlier release give the fields
// that it had.
Result<GivenOptions> OptionsOf(const cairn_map_options* options) {
  GivenOptions given;
  if (options == nullptr) return given;
  CAIRN_RETURN_IF_ERROR(CheckStruct(options, "options", offsetof(cairn_map_options, name)));
  cairn_map_options asked = CAIRN_MAP_OPTIONS_INIT;
  std::memcpy(&asked, options, std::min(options->size, sizeof(asked)));
  if (asked.memory_budget_bytes < 0)
    return Misuse("options->memory_budget_bytes is {}; must not be negative", asked.memory_budget_bytes);
  if (asked.memory_budget_bytes > 0) given.map.memory_budget_bytes = asked.memory_budget_bytes;
  if (asked.public_key != nullptr) {
    PublicKey& key = given.map.public_key.emplace();
    std::copy_n(asked.public_key, key.size(), key.begin());
  }
  if (asked.name != nullptr) given.map.name = asked.name;
  given.map.min_epoch = asked.min_epoch;
  if (asked.allow_older != 0 && asked.allow_older != 1)
    return Misuse("options->allow_older is {}; expected 0 or 1", asked.allow_older);
  given.update = {.public_key = given.map.public_key,
                  .allow_older = asked.allow_older == 1,
                  .name = given.map.name,
                  .min_epoch = given.map.min_epoch};
  return given;
}

Result<std::shared_ptr<const Map>> FindMap(const cairn_map* handle) {
  if (auto map = Maps().Find(handle)) return map;
  return Misuse("map is {}", handle == nullptr ? "NULL" : "not an open map: it was closed, or never opened");
}

Result<std::shared_ptr<OpenLocalizer>> FindLocalizer(const cairn_localizer* handle) {
  if (auto localizer = Localizers().Find(handle)) return localizer;
  return Misuse("localizer is {}",
                handle == nullptr ? "NULL" : "not a localizer: it was destroyed, or never created");
}

// Holds a localizer for one thread.
class Use {
 public:
  static Result<Use> Begin(const cairn_localizer* handle) {
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<OpenLocalizer> localizer, FindLocalizer(handle));
    if (localizer->is_in_use.exchange(true, std::memory_order_acquire))
      return MakeError(ErrorCode::kBusy,
                       "another thread is using this localizer; create one per thread, they share the map");
    return Use(std::move(localizer));
  }
  Use(Use&&) noexcept = default;
  ~Use() {
    if (localizer_) localizer_->is_in_use.store(false, std::memory_order_release);
  }
  OpenLocalizer* operator->() const { return localizer_.get(); }

 private:
  explicit Use(std::shared_ptr<OpenLocalizer> localizer) : localizer_(std::move(localizer)) {}
  std::shared_ptr<OpenLocalizer> localizer_;
};

// A longer stride is an overflowed sum, not a distance between rows.
constexpr size_t kMaxStrideBytes = size_t{1} << 31;

// The caller's pixels, not copied.
Result<cv::Mat> PixelsOf(const cairn_image* image) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(image, "image"));
  if (image->pixels == nullptr) return Misuse("image->pixels is NULL");
  if (image->width <= 0 || image->height <= 0 || image->width > 65536 || image->height > 65536)
    return Misuse("an image of {} x {} px; both must be in 1 .. 65536", image->width, image->height);
  const size_t width = static_cast<size_t>(image->width);
  const size_t stride = image->stride == 0 ? width : image->stride;
  if (stride < width)
    return Misuse("image->stride is {} bytes, but a row has {}; grey pixels take a byte each", stride, width);
  if (stride > kMaxStrideBytes)
    return Misuse("image->stride is {} bytes; at most {} from one row to the next", stride, kMaxStrideBytes);
  return cv::Mat(image->height, image->width, CV_8UC1, const_cast<uint8_t*>(image->pixels), stride);
}

Result<Camera> CameraOf(const cairn_camera* given, const Map& map, const cv::Mat& grey) {
  if (given == nullptr) return map.CameraForSize(grey.cols, grey.rows);
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "camera"));
  if (given->num_params < 0 || given->num_params > CAIRN_MAX_CAMERA_PARAMS)
    return Misuse("camera->num_params is {}; no model has more than {}", given->num_params,
                  CAIRN_MAX_CAMERA_PARAMS);
  Camera camera;
  CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromId(given->model));
  camera.width = given->width;
  camera.height = given->height;
  camera.params.assign(given->params, given->params + given->num_params);
  return camera;
}

Result<std::optional<PosePrior>> PriorOf(const cairn_prior* given) {
  if (given == nullptr) return std::optional<PosePrior>();
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "prior"));
  const double* q = given->rotation_wxyz;
  const double* t = given->translation_m;
  PosePrior prior = {.cam_from_world = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {t[0], t[1], t[2]}},
                     .sigma_m = given->sigma_m,
                     .sigma_deg = given->sigma_deg};
  const double norm = prior.cam_from_world.rotation.norm();
  if (!(std::abs(norm - 1) < 1e-3))
    return Misuse("prior->rotation_wxyz has the length {}; expected a unit quaternion, w first", norm);
  if (!prior.cam_from_world.translation.allFinite()) return Misuse("prior->translation_m is not finite");
  if (!(prior.sigma_m > 0 && prior.sigma_deg > 0 && std::isfinite(prior.sigma_m + prior.sigma_deg)))
    return Misuse("prior->sigma_m is {} and sigma_deg {}; both must be positive", prior.sigma_m,
                  prior.sigma_deg);
  prior.cam_from_world.rotation.normalize();
  return std::optional(prior);
}

cairn_fix FixOf(const Localization& found) {
  cairn_fix fix = CAIRN_FIX_INIT;
  fix.has_fix = found.has_fix();
  fix.reason = static_cast<int32_t>(found.reason);
  fix.region = found.region;
  fix.num_features = found.num_features;
  fix.num_matches = found.num_matches;
  fix.num_inliers = found.num_inliers;
  CopyText(found.message, fix.message);
  if (!found.has_fix()) return fix;
  const Eigen::Quaterniond& q = found.cam_from_world.rotation;
  const Eigen::Vector3d center = found.cam_from_world.Center();
  const std::array<double, 4> wxyz = {q.w(), q.x(), q.y(), q.z()};
  std::copy(wxyz.begin(), wxyz.end(), fix.rotation_wxyz);
  for (int i = 0; i < 3; ++i) {
    fix.translation_m[i] = found.cam_from_world.translation[i];
    fix.center_m[i] = center[i];
  }
  for (int i = 0; i < 36; ++i) fix.covariance[i] = found.covariance(i / 6, i % 6);
  return fix;
}

cairn_floor_fix FloorFixFromPose(const VisualPose& found) {
  cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
  fix.has_fix = found.flag == VisualFlag::kNone;
  fix.num_matches = found.num_matches;
  fix.num_agreeing = found.num_agreeing;
  for (int i = 0; i < 9; ++i) fix.covariance[i] = found.covariance(i / 3, i % 3);
  CopyText(found.message, fix.message);
  if (!fix.has_fix) return fix;
  fix.position_m[0] = found.position.x();
  fix.position_m[1] = found.position.y();
  fix.heading_deg = found.heading_deg;
  return fix;
}

}  // namespace
}  // namespace cairn

using namespace cairn;  // NOLINT: what follows is C, in the global namespace

const char* cairn_version(void) { return CAIRN_VERSION; }

const char* cairn_error_name(int32_t code) {
  if (code == CAIRN_OK) return "ok";
  return code < CAIRN_OK || code > CAIRN_OTHER_MAP ? "unknown" : ErrorCodeName(static_cast<ErrorCode>(code));
}

const char* cairn_reason_name(int32_t reason) {
  return reason < CAIRN_FIX || reason > CAIRN_AMBIGUOUS ? "unknown" : NoFixName(static_cast<NoFix>(reason));
}

const char* cairn_last_error(void) { return LastError().c_str(); }

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

int32_t cairn_map_open(const char* path, const cairn_map_options* options, cairn_map** map) {
  if (map != nullptr) *map = nullptr;
  return Call("cairn_map_open", [&]() -> Status {
    if (path == nullptr) return Misuse("path is NULL");
    if (map == nullptr) return Misuse("map is NULL: there is no place for the handle");
    CAIRN_ASSIGN_OR_RETURN(const GivenOptions given, OptionsOf(options));
    CAIRN_ASSIGN_OR_RETURN(std::shared_ptr<const Map> open, Map::Open(path, given.map));
    *map = Maps().Add(std::move(open));
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
    said.is_metric = open->head().frame.unit == "metre";
    CopyText(open->head().name, said.name);
    said.epoch = open->head().epoch;
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
    if (map != nullptr && !Maps().Remove(map)) return FindMap(map).error();
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
    *localizer = Localizers().Add(std::move(created));
    return Ok();
  });
}

int32_t cairn_localizer_set_option(cairn_localizer* localizer, const char* name, const char* value) {
  return Call("cairn_localizer_set_option", [&]() -> Status {
    if (name == nullptr || value == nullptr) return Misuse("{} is NULL", name == nullptr ? "name" : "value");
    CAIRN_ASSIGN_OR_RETURN(const Use used, Use::Begin(localizer));
    LocalizerOptions options = used->localizer->options();
    const OptionTable table = DescribeOptions(&options);
    CAIRN_ASSIGN_OR_RETURN(const Option* const option,
                           FindOption(table, name, "`cairn localize --help` lists them"));
    CAIRN_RETURN_IF_ERROR(SetOption(*option, value));
    used->localizer = std::make_unique<Localizer>(used->map, options);
    return Ok();
  });
}

int32_t cairn_localizer_destroy(cairn_localizer* localizer) {
  return Call("cairn_localizer_destroy", [&]() -> Status {
    if (localizer != nullptr && !Localizers().Remove(localizer)) return FindLocalizer(localizer).error();
    return Ok();
  });
}

int32_t cairn_localize(cairn_localizer* localizer, const cairn_image* image, const cairn_camera* camera,
                       const cairn_prior* prior, cairn_fix* fix) {
  return Call("cairn_localize", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckStruct(fix, "fix"));
    Return(FixOf({}), fix);  // after an error the caller must not find the previous fix
    CAIRN_ASSIGN_OR_RETURN(const Use used, Use::Begin(localizer));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    CAIRN_ASSIGN_OR_RETURN(const std::optional<PosePrior> believed, PriorOf(prior));
    CAIRN_ASSIGN_OR_RETURN(const Localization found, used->localizer->Localize(grey, chosen, believed));
    Return(FixOf(found), fix);
    return Ok();
  });
}

int32_t cairn_localize_on_floor(cairn_localizer* localizer, const cairn_image* image,
                                const cairn_camera* camera, cairn_floor_fix* fix) {
  return Call("cairn_localize_on_floor", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckStruct(fix, "fix"));
    Return(cairn_floor_fix CAIRN_FLOOR_FIX_INIT, fix);
    CAIRN_ASSIGN_OR_RETURN(const Use used, Use::Begin(localizer));
    CAIRN_ASSIGN_OR_RETURN(const cv::Mat grey, PixelsOf(image));
    CAIRN_ASSIGN_OR_RETURN(const Camera chosen, CameraOf(camera, *used->map, grey));
    if (!used->visual) {
      CAIRN_ASSIGN_OR_RETURN(used->visual, VisualMap::Open(used->map));
    }
    CAIRN_ASSIGN_OR_RETURN(const Query query, used->localizer->QueryFromImage(grey, chosen));
    CAIRN_ASSIGN_OR_RETURN(const auto seen, used->visual->Match(query));
    CAIRN_ASSIGN_OR_RETURN(const VisualPose found, EstimateVisualPose(*used->visual, seen));
    Return(FloorFixFromPose(found), fix);
    return Ok();
  });
}
