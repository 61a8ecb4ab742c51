#include "stages/match_features/pairs/image_features.h"

#include <algorithm>
#include <limits>

#include "core/base/pooled.h"
#include "core/camera/panorama.h"
#include "core/capture/sessions.h"
#include "core/features/descriptor_kind_table.h"

namespace cairn::match_features {
namespace {

// Number of rows that a table of features states for each image.
Result<std::map<ImageId, int64_t>> ReadRowCounts(SQLite::Database& database, const std::string& table) {
  std::map<ImageId, int64_t> counts;
  LimitedStatement query(database, "SELECT image_id, rows FROM " + table);
  while (query.executeStep()) {
    const int64_t rows = query.getColumn(1).getInt64();
    if (rows < 0 || rows > std::numeric_limits<int>::max()) {
      return MakeError(ErrorCode::kCorrupt, "{}: table {}, row {}: {} rows", DatabasePath(database), table,
                       query.getColumn(0).getInt64(), rows);
    }
    counts[query.getColumn(0).getUInt()] = rows;
  }
  return counts;
}

std::vector<Eigen::Vector3d> BearingsOf(const PooledVector<Keypoint>& keypoints, const Camera& camera) {
  std::vector<Eigen::Vector3d> bearings;
  bearings.reserve(keypoints.size());
  for (const Keypoint& keypoint : keypoints) {
    const auto bearing = BearingFromImage(camera, Eigen::Vector2d(keypoint.x, keypoint.y));
    bearings.push_back(bearing.value_or(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())));
  }
  return bearings;
}

}  // namespace

bool MatchImages::AllPosed() const {
  return std::all_of(images.begin(), images.end(),
                     [](const MatchImage& image) { return image.cam_from_world.has_value(); });
}

Result<MatchImages> ReadMatchImages(SQLite::Database& database, const Capture* capture) {
  MatchImages result;
  CAIRN_ASSIGN_OR_RETURN(result.descriptor_kind, ReadDescriptorKind(database, DatabasePath(database)));
  CAIRN_ASSIGN_OR_RETURN(result.cameras, ReadDatabaseCameras(database));
  CAIRN_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(database));
  CAIRN_ASSIGN_OR_RETURN(auto num_keypoints, ReadRowCounts(database, "keypoints"));
  CAIRN_ASSIGN_OR_RETURN(auto num_descriptors, ReadRowCounts(database, "descriptors"));
  std::map<std::string, Pose> poses;
  if (capture != nullptr) {
    for (const CaptureImage& image : capture->images) {
      if (image.cam_from_world) poses.emplace(image.name, *image.cam_from_world);
    }
  }
  for (const DatabaseImage& image : images) {
    if (!result.cameras.contains(image.camera_id)) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the database does not list",
                       DatabasePath(database), image.name, image.camera_id);
    }
    if (num_keypoints[image.image_id] != num_descriptors[image.image_id]) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints but {} descriptors",
                       DatabasePath(database), image.name, num_keypoints[image.image_id],
                       num_descriptors[image.image_id]);
    }
    if (num_keypoints[image.image_id] == 0) {
      result.without_features.emplace(image.name, image.image_id);
      continue;
    }
    MatchImage match_image{.image_id = image.image_id, .name = image.name, .camera_id = image.camera_id};
    match_image.cam_from_world = FindPose(poses, image.name);
    if (capture != nullptr) match_image.session = std::max(0, SessionOfImage(capture->sessions, image.name));
    match_image.num_features = static_cast<int>(num_keypoints[image.image_id]);
    result.images.push_back(std::move(match_image));
  }
  return result;
}

int64_t ImageFeatures::NumBytes(int num_features, const DescriptorKind& kind, const NeededFeatures& needed) {
  const auto num = static_cast<size_t>(num_features);
  const size_t num_values = needed.descriptors ? kind.num_values : 0;
  return PackedDescriptors::NumBytes(num_features, kind.num_values) +
         static_cast<int64_t>(PooledSize(num * sizeof(Keypoint)) + num * sizeof(Eigen::Vector3d) +
                              PooledSize(num * num_values)) +
         (needed.index ? ApproximateIndex::NumBytes(num_features, kind.space()) : 0);
}

Result<ImageFeatures> ReadImageFeatures(SQLite::Database& database, const MatchImage& image,
                                        const Camera& camera, const DescriptorKind& kind,
                                        const NeededFeatures& needed) {
  ImageFeatures features;
  CAIRN_ASSIGN_OR_RETURN(features.descriptors, ReadDatabaseDescriptors(database, image.image_id, kind));
  CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image.image_id));
  // A table without its key may have another row of the image that was counted.
  const auto num_keypoints = static_cast<int64_t>(features.keypoints.size());
  if (num_keypoints != image.num_features || features.descriptors.rows() != image.num_features) {
    return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints and {} descriptors, expected {}",
                     DatabasePath(database), image.name, num_keypoints, features.descriptors.rows(),
                     image.num_features);
  }
  features.packed = PackedDescriptors(features.descriptors, kind.space());
  features.bearings = BearingsOf(features.keypoints, camera);
  if (needed.index) features.index.emplace(features.descriptors, kind.space());
  if (!needed.descriptors) features.descriptors = {};
  return features;
}

Result<std::vector<Eigen::Vector3d>> ReadImageBearings(SQLite::Database& database, const MatchImage& image,
                                                       const Camera& camera) {
  CAIRN_ASSIGN_OR_RETURN(const PooledVector<Keypoint> keypoints,
                         ReadDatabaseKeypoints(database, image.image_id));
  return BearingsOf(keypoints, camera);
}

}  // namespace cairn::match_features
