#include "runtime/c_api/structs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "runtime/c_api/calls.h"

namespace cairn {
namespace {

static_assert(CAIRN_OVER_BUDGET == static_cast<int>(NoFix::kOverBudget));
static_assert(CAIRN_SCOPE_VOTES == static_cast<int>(Scope::kVotes));

// A longer stride is an overflowed sum, not a distance between rows.
constexpr size_t kMaxStrideBytes = size_t{1} << 31;

void CopyPose(const Pose& pose, double (&rotation_wxyz)[4], double (&translation_m)[3]) {
  const Eigen::Quaterniond& q = pose.rotation;
  const std::array<double, 4> wxyz = {q.w(), q.x(), q.y(), q.z()};
  std::copy(wxyz.begin(), wxyz.end(), rotation_wxyz);
  for (int i = 0; i < 3; ++i) translation_m[i] = pose.translation[i];
}

}  // namespace

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
    PublicKey key;
    std::copy_n(asked.public_key, key.size(), key.begin());
    given.map.public_key = key;
  }
  if (asked.key_ring != nullptr && asked.key_ring[0] != '\0') {
    if (asked.public_key != nullptr)
      return Misuse("options has a public_key and a key_ring; give one of them");
    CAIRN_ASSIGN_OR_RETURN(given.map.public_key, ReadTrustedKeys(asked.key_ring));
  }
  if (asked.name != nullptr) given.map.name = asked.name;
  given.map.min_epoch = asked.min_epoch;
  if (asked.allow_older != 0 && asked.allow_older != 1)
    return Misuse("options->allow_older is {}; expected 0 or 1", asked.allow_older);
  given.update = {.public_key = given.map.public_key,
                  .allow_older = asked.allow_older == 1,
                  .name = given.map.name,
                  .min_epoch = given.map.min_epoch,
                  .signatures = asked.signatures == nullptr ? "" : asked.signatures};
  return given;
}

Result<std::optional<Camera>> GivenCameraOf(const cairn_camera* given) {
  if (given == nullptr) return std::optional<Camera>();
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "camera"));
  if (given->num_params < 0 || given->num_params > CAIRN_MAX_CAMERA_PARAMS)
    return Misuse("camera->num_params is {}; no model has more than {}", given->num_params,
                  CAIRN_MAX_CAMERA_PARAMS);
  Camera camera;
  CAIRN_ASSIGN_OR_RETURN(camera.model, CameraModelFromId(given->model));
  camera.width = given->width;
  camera.height = given->height;
  camera.params.assign(given->params, given->params + given->num_params);
  return std::optional(std::move(camera));
}

Result<Camera> CameraOf(const cairn_camera* given, const Map& map, const cv::Mat& grey) {
  CAIRN_ASSIGN_OR_RETURN(const std::optional<Camera> camera, GivenCameraOf(given));
  return camera ? Result<Camera>(*camera) : map.CameraForSize(grey.cols, grey.rows);
}

Result<std::vector<RigImage>> RigImagesOf(const cairn_rig_image* const* images, int32_t num_images,
                                          const Map& map) {
  constexpr int32_t kMaxNumImages = 64;
  if (images == nullptr) return Misuse("images is NULL");
  if (num_images < 1 || num_images > kMaxNumImages)
    return Misuse("num_images is {}; expected 1 to {}", num_images, kMaxNumImages);
  std::vector<RigImage> rig;
  for (int32_t i = 0; i < num_images; ++i) {
    CAIRN_RETURN_IF_ERROR(CheckStruct(images[i], "images"));
    RigImage of_camera;
    CAIRN_ASSIGN_OR_RETURN(of_camera.grey, PixelsOf(images[i]->image));
    CAIRN_ASSIGN_OR_RETURN(of_camera.camera, CameraOf(images[i]->camera, map, of_camera.grey));
    const double* q = images[i]->rotation_wxyz;
    of_camera.cam_from_rig = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                              Eigen::Vector3d(images[i]->translation_m)};
    rig.push_back(std::move(of_camera));
  }
  return rig;
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

cairn_prior PriorFrom(const PosePrior& prior) {
  cairn_prior given = CAIRN_PRIOR_INIT;
  CopyPose(prior.cam_from_world, given.rotation_wxyz, given.translation_m);
  given.sigma_m = prior.sigma_m;
  given.sigma_deg = prior.sigma_deg;
  return given;
}

Result<UncertainPose> UncertainPoseOf(const cairn_uncertain_pose* given) {
  CAIRN_RETURN_IF_ERROR(CheckStruct(given, "pose"));
  const double* q = given->rotation_wxyz;
  UncertainPose pose{{Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(given->translation_m)},
                     Eigen::Map<const Matrix6d>(given->covariance)};
  CAIRN_RETURN_IF_ERROR(CheckUncertainPose(pose));
  return pose;
}

cairn_uncertain_pose UncertainPoseFrom(const UncertainPose& pose) {
  cairn_uncertain_pose given = CAIRN_UNCERTAIN_POSE_INIT;
  CopyPose(pose.pose, given.rotation_wxyz, given.translation_m);
  std::copy_n(pose.covariance.data(), 36, given.covariance);
  return given;
}

Status CheckFix(const cairn_fix* fix) { return CheckStruct(fix, "fix", offsetof(cairn_fix, scope)); }

Status CheckFix(const cairn_floor_fix* fix) {
  return CheckStruct(fix, "fix", offsetof(cairn_floor_fix, mean_m));
}

cairn_fix FixFrom(const Localization& found) {
  cairn_fix fix = CAIRN_FIX_INIT;
  fix.has_fix = found.has_fix();
  fix.reason = static_cast<int32_t>(found.reason);
  fix.region = found.region;
  fix.num_features = found.num_features;
  fix.num_matches = found.num_matches;
  fix.num_inliers = found.num_inliers;
  fix.scope = static_cast<int32_t>(found.scope);
  fix.probability = found.probability;
  fix.work_ms = found.work_ms;
  CopyText(found.message, fix.message);
  if (!found.has_fix()) return fix;
  CopyPose(found.cam_from_world, fix.rotation_wxyz, fix.translation_m);
  const Eigen::Vector3d center = found.cam_from_world.Center();
  for (int i = 0; i < 3; ++i) fix.center_m[i] = center[i];
  for (int i = 0; i < 36; ++i) fix.covariance[i] = found.covariance(i / 6, i % 6);
  return fix;
}

cairn_floor_fix FloorFixFrom(const VisualPose& found, Scope scope) {
  cairn_floor_fix fix = CAIRN_FLOOR_FIX_INIT;
  fix.has_fix = found.flag == VisualFlag::kNone;
  fix.num_matches = found.num_matches;
  fix.num_agreeing = found.num_agreeing;
  fix.scope = static_cast<int32_t>(scope);
  for (int i = 0; i < 9; ++i) fix.covariance[i] = found.covariance(i / 3, i % 3);
  for (int i = 0; i < 2; ++i) fix.mean_m[i] = found.mean[i];
  fix.entropy = found.entropy;
  CopyText(found.message, fix.message);
  if (!fix.has_fix) return fix;
  fix.position_m[0] = found.position.x();
  fix.position_m[1] = found.position.y();
  fix.heading_deg = found.heading_deg;
  return fix;
}

cairn_survey_image SurveyImageFrom(const std::string& name, const Pose& cam_from_world) {
  cairn_survey_image image = CAIRN_SURVEY_IMAGE_INIT;
  CopyText(name, image.name);
  CopyPose(cam_from_world, image.rotation_wxyz, image.translation_m);
  const Eigen::Vector3d center = cam_from_world.Center();
  for (int i = 0; i < 3; ++i) image.center_m[i] = center[i];
  return image;
}

}  // namespace cairn
