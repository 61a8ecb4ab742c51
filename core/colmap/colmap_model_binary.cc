#include <filesystem>

#include "core/base/blob.h"
#include "core/colmap/colmap_model.h"
#include "core/files/file.h"

namespace cairn {
namespace {

Error Truncated(const std::string& path, size_t num_bytes) {
  return MakeError(ErrorCode::kCorrupt,
                   "{}: not a whole COLMAP file: its {} bytes end inside a row, or more than its rows are "
                   "there; copy it again",
                   path, num_bytes);
}

Status ReadCameras(const std::string& path, ColmapModel* model) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  BlobReader reader(bytes);
  const uint64_t num_cameras = reader.UInt64();
  for (uint64_t i = 0; i < num_cameras; ++i) {
    Camera camera;
    camera.camera_id = reader.UInt32();
    const auto model_id = static_cast<int32_t>(reader.UInt32());
    const uint64_t width = reader.UInt64(), height = reader.UInt64();
    if (!reader.ok()) return Truncated(path, bytes.size());
    const Result<CameraModel> camera_model = CameraModelFromId(model_id);
    if (!camera_model.ok()) {
      return MakeError(camera_model.error().code, "{}: camera {}: {}", path, camera.camera_id,
                       camera_model.error().message);
    }
    camera.model = *camera_model;
    camera.width = static_cast<int>(std::min<uint64_t>(width, 1u << 30));
    camera.height = static_cast<int>(std::min<uint64_t>(height, 1u << 30));
    for (int k = 0; k < NumCameraParams(camera.model); ++k) camera.params.push_back(reader.Float64());
    if (!reader.ok()) return Truncated(path, bytes.size());
    if (const Status status = CheckCamera(camera); !status.ok())
      return MakeError(ErrorCode::kCorrupt, "{}: {}", path, status.error().message);
    if (!model->cameras.emplace(camera.camera_id, camera).second)
      return MakeError(ErrorCode::kCorrupt, "{}: camera {} is listed twice", path, camera.camera_id);
  }
  return reader.Finished() ? Ok() : Status(Truncated(path, bytes.size()));
}

Status ReadBinaryImages(const std::string& path, ColmapModel* model) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  BlobReader reader(bytes);
  const uint64_t num_images = reader.UInt64();
  for (uint64_t i = 0; i < num_images; ++i) {
    ModelImage image;
    image.image_id = reader.UInt32();
    Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) *value = reader.Float64();
    for (double& value : image.cam_from_world.translation) value = reader.Float64();
    image.camera_id = reader.UInt32();
    image.name = reader.ZeroTerminated();
    const uint64_t num_keypoints = reader.UInt64();
    // Nothing is allocated that the file cannot hold: a keypoint takes 24 bytes.
    if (!reader.ok() || num_keypoints > reader.num_left() / 24) return Truncated(path, bytes.size());
    image.keypoints.resize(num_keypoints);
    for (ModelKeypoint& keypoint : image.keypoints) {
      keypoint.position.x() = reader.Float64();
      keypoint.position.y() = reader.Float64();
      keypoint.point_id = reader.UInt64();
    }
    if (const Status status = NormalizePose(&image.cam_from_world); !status.ok()) {
      return MakeError(status.error().code, "{}: image {} ({}): {}", path, image.image_id, image.name,
                       status.error().message);
    }
    model->images.push_back(std::move(image));
  }
  return reader.Finished() ? Ok() : Status(Truncated(path, bytes.size()));
}

Status ReadBinaryPoints(const std::string& path, ColmapModel* model) {
  CAIRN_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  BlobReader reader(bytes);
  const uint64_t num_points = reader.UInt64();
  for (uint64_t i = 0; i < num_points; ++i) {
    ModelPoint point;
    point.point_id = reader.UInt64();
    for (double& value : point.position) value = reader.Float64();
    for (uint8_t& channel : point.color) channel = reader.UInt8();
    point.error_px = reader.Float64();
    const uint64_t track_length = reader.UInt64();
    if (!reader.ok() || track_length > reader.num_left() / 8) return Truncated(path, bytes.size());
    point.track.resize(track_length);
    for (auto& [image_id, keypoint_idx] : point.track) {
      image_id = reader.UInt32();
      keypoint_idx = reader.UInt32();
    }
    if (!point.position.allFinite())
      return MakeError(ErrorCode::kCorrupt, "{}: point {}: position is not finite", path, point.point_id);
    model->points.push_back(std::move(point));
  }
  return reader.Finished() ? Ok() : Status(Truncated(path, bytes.size()));
}

std::string CamerasBytes(const ColmapModel& model) {
  BlobWriter writer;
  writer.UInt64(model.cameras.size());
  for (const auto& [camera_id, camera] : model.cameras) {
    writer.UInt32(camera_id);
    writer.UInt32(static_cast<uint32_t>(camera.model));
    writer.UInt64(camera.width);
    writer.UInt64(camera.height);
    for (const double param : camera.params) writer.Float64(param);
  }
  return writer.Take();
}

std::string ImagesBytes(const ColmapModel& model) {
  BlobWriter writer;
  writer.UInt64(model.images.size());
  for (const ModelImage& image : model.images) {
    writer.UInt32(image.image_id);
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) writer.Float64(value);
    for (const double value : image.cam_from_world.translation) writer.Float64(value);
    writer.UInt32(image.camera_id);
    writer.ZeroTerminated(image.name);
    writer.UInt64(image.keypoints.size());
    for (const ModelKeypoint& keypoint : image.keypoints) {
      writer.Float64(keypoint.position.x());
      writer.Float64(keypoint.position.y());
      writer.UInt64(keypoint.point_id);
    }
  }
  return writer.Take();
}

std::string PointsBytes(const ColmapModel& model) {
  BlobWriter writer;
  writer.UInt64(model.points.size());
  for (const ModelPoint& point : model.points) {
    writer.UInt64(point.point_id);
    for (const double value : point.position) writer.Float64(value);
    writer.Bytes(point.color.data(), point.color.size());
    writer.Float64(point.error_px);
    writer.UInt64(point.track.size());
    for (const auto& [image_id, keypoint_idx] : point.track) {
      writer.UInt32(image_id);
      writer.UInt32(keypoint_idx);
    }
  }
  return writer.Take();
}

}  // namespace

Result<ColmapModel> ReadColmapModelBinary(const std::string& folder) {
  ColmapModel model;
  CAIRN_RETURN_IF_ERROR(ReadCameras(folder + "/cameras.bin", &model));
  CAIRN_RETURN_IF_ERROR(ReadBinaryImages(folder + "/images.bin", &model));
  const std::string points_path = folder + "/points3D.bin";
  std::error_code error;
  if (std::filesystem::exists(points_path, error))
    CAIRN_RETURN_IF_ERROR(ReadBinaryPoints(points_path, &model));
  return model;
}

Status WriteColmapModelBinary(const ColmapModel& model, const std::string& folder) {
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/cameras.bin", CamerasBytes(model)));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/images.bin", ImagesBytes(model)));
  return WriteFileAtomically(folder + "/points3D.bin", PointsBytes(model));
}

}  // namespace cairn
