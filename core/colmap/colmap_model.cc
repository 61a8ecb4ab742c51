#include "core/colmap/colmap_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <unordered_map>
#include <unordered_set>

namespace cairn {
namespace {

constexpr double kMaxQuaternionNormError = 0.01;

bool HasFiles(const std::string& folder, const char* suffix) {
  std::error_code error;
  return std::filesystem::is_regular_file(folder + "/cameras" + suffix, error) &&
         std::filesystem::is_regular_file(folder + "/images" + suffix, error);
}

// Sorts by id.  Errors: Corrupt for an id listed twice.
template <typename T, typename Id>
Status SortById(std::vector<T>* elements, Id T::*id, const std::string& folder, const char* what) {
  std::stable_sort(elements->begin(), elements->end(), [&](const T& a, const T& b) { return a.*id < b.*id; });
  const auto twice = std::adjacent_find(elements->begin(), elements->end(),
                                        [&](const T& a, const T& b) { return a.*id == b.*id; });
  if (twice == elements->end()) return Ok();
  return MakeError(ErrorCode::kCorrupt, "{}: {} {} is listed twice", folder, what, *twice.*id);
}

Status CheckReferences(const ColmapModel& model, const std::string& folder) {
  std::unordered_map<ImageId, size_t> num_keypoints;
  std::unordered_set<uint64_t> point_ids;
  for (const ModelPoint& point : model.points) point_ids.insert(point.point_id);
  for (const ModelImage& image : model.images) {
    if (!model.cameras.contains(image.camera_id)) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} ({}) has camera {}, which cameras does not list",
                       folder, image.image_id, image.name, image.camera_id);
    }
    num_keypoints.emplace(image.image_id, image.keypoints.size());
    if (model.points.empty()) continue;
    for (const ModelKeypoint& keypoint : image.keypoints) {
      if (keypoint.point_id == kNoPoint || point_ids.contains(keypoint.point_id)) continue;
      return MakeError(ErrorCode::kCorrupt, "{}: image {} ({}) sees point {}, which points3D does not list",
                       folder, image.image_id, image.name, keypoint.point_id);
    }
  }
  for (const ModelPoint& point : model.points) {
    for (const auto& [image_id, keypoint_idx] : point.track) {
      const auto image = num_keypoints.find(image_id);
      if (image != num_keypoints.end() && keypoint_idx < image->second) continue;
      return MakeError(ErrorCode::kCorrupt,
                       "{}: the track of point {} has keypoint {} of image {}, which images does not list",
                       folder, point.point_id, keypoint_idx, image_id);
    }
  }
  return Ok();
}

}  // namespace

bool IsColmapModel(const std::string& folder) { return HasFiles(folder, ".bin") || HasFiles(folder, ".txt"); }

Status NormalizePose(Pose* pose) {
  const double norm = pose->rotation.norm();
  if (!pose->translation.allFinite() || !std::isfinite(norm))
    return MakeError(ErrorCode::kCorrupt, "pose is not finite");
  if (std::abs(norm - 1) > kMaxQuaternionNormError)
    return MakeError(ErrorCode::kCorrupt, "quaternion of norm {:g}, expected 1", norm);
  pose->rotation.normalize();
  return Ok();
}

Result<ColmapModel> ReadColmapModel(const std::string& folder) {
  if (!IsColmapModel(folder)) {
    return MakeError(
        ErrorCode::kNotFound,
        "{}: not a COLMAP model: it has neither cameras.bin and images.bin nor cameras.txt and images.txt",
        folder);
  }
  CAIRN_ASSIGN_OR_RETURN(ColmapModel model, HasFiles(folder, ".bin") ? ReadColmapModelBinary(folder)
                                                                     : ReadColmapModelText(folder));
  CAIRN_RETURN_IF_ERROR(SortById(&model.images, &ModelImage::image_id, folder, "image"));
  CAIRN_RETURN_IF_ERROR(SortById(&model.points, &ModelPoint::point_id, folder, "point"));
  CAIRN_RETURN_IF_ERROR(CheckReferences(model, folder));
  return model;
}

Status WriteColmapModel(const ColmapModel& model, ModelFormat format, const std::string& folder) {
  return format == ModelFormat::kBinary ? WriteColmapModelBinary(model, folder)
                                        : WriteColmapModelText(model, folder);
}

}  // namespace cairn
