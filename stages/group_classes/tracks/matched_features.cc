#include "stages/group_classes/tracks/matched_features.h"

#include <utility>

#include "core/colmap/landmark_images.h"
#include "core/features/descriptor_kind_table.h"
#include "core/files/database.h"

namespace cairn::group_classes {

Result<MatchedFeatures> ReadMatchedFeatures(const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<MatchedFeatures> {
    MatchedFeatures matched;
    CAIRN_ASSIGN_OR_RETURN(matched.cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(matched.images, ReadDatabaseImages(database));
    CAIRN_ASSIGN_OR_RETURN(const DescriptorKind kind, ReadDescriptorKind(database, matches_path));
    for (const DatabaseImage& image : matched.images) {
      if (matched.cameras.count(image.camera_id) == 0) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the database does not list",
                         matches_path, image.name, image.camera_id);
      }
      Features features{.keypoints = {}, .descriptors = {}, .kind = kind};
      CAIRN_ASSIGN_OR_RETURN(features.keypoints, ReadDatabaseKeypoints(database, image.image_id));
      matched.features.push_back(std::move(features));
    }
    matched.landmark_images = ReadLandmarkImages(database);
    matched.path = matches_path;
    matched.database = std::make_shared<SQLite::Database>(std::move(database));
    return matched;
  });
}

Status MatchReader::ForEachPair(const std::function<Status(const TwoViewGeometry&)>& visit) {
  if (!matched_.database) {
    for (const TwoViewGeometry& geometry : matched_.geometries) CAIRN_RETURN_IF_ERROR(visit(geometry));
    return Ok();
  }
  return WithDatabaseErrors(matched_.path,
                            [&]() -> Status { return ForEachTwoViewGeometry(*matched_.database, 1, visit); });
}

Result<std::shared_ptr<const DescriptorMatrix>> MatchReader::DescriptorsOf(int image) {
  const Features& features = matched_.features[image];
  if (!matched_.database)
    return std::shared_ptr<const DescriptorMatrix>(std::shared_ptr<void>(), &features.descriptors);
  if (const auto kept = kept_.find(image); kept != kept_.end()) {
    images_.splice(images_.begin(), images_, kept->second.place);
    return kept->second.descriptors;
  }
  const DatabaseImage& of = matched_.images[image];
  return WithDatabaseErrors(matched_.path, [&]() -> Result<std::shared_ptr<const DescriptorMatrix>> {
    CAIRN_ASSIGN_OR_RETURN(DescriptorMatrix read,
                           ReadDatabaseDescriptors(*matched_.database, of.image_id, features.kind));
    if (static_cast<size_t>(read.rows()) != features.keypoints.size()) {
      return MakeError(ErrorCode::kCorrupt, "{}: image {} has {} keypoints but {} descriptors", matched_.path,
                       of.name, features.keypoints.size(), read.rows());
    }
    const auto bytes_of = [](const DescriptorMatrix& matrix) {
      return static_cast<size_t>(matrix.rows() * matrix.cols());
    };
    num_bytes_ += bytes_of(read);
    while (num_bytes_ > max_num_bytes_ && !images_.empty()) {
      num_bytes_ -= bytes_of(*kept_.at(images_.back()).descriptors);
      kept_.erase(images_.back());
      images_.pop_back();
    }
    images_.push_front(image);
    auto descriptors = std::make_shared<const DescriptorMatrix>(std::move(read));
    kept_.emplace(image, Kept{descriptors, images_.begin()});
    return descriptors;
  });
}

}  // namespace cairn::group_classes
