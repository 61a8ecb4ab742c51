#include "stages/reconstruct/view_graph/mapper_input.h"

#include <algorithm>

namespace cairn::reconstruct {

std::map<ImageId, int> IndexOf(const MapperInput& input) {
  std::map<ImageId, int> index;
  for (size_t i = 0; i < input.images.size(); ++i)
    index.emplace(input.images[i].image_id, static_cast<int>(i));
  return index;
}

Result<MapperInput> ReadMapperInput(const std::string& matches_path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenColmapDatabase(matches_path));
  return WithDatabaseErrors(matches_path, [&]() -> Result<MapperInput> {
    MapperInput input;
    CAIRN_ASSIGN_OR_RETURN(input.cameras, ReadDatabaseCameras(database));
    CAIRN_ASSIGN_OR_RETURN(input.images, ReadDatabaseImages(database));
    std::map<ImageId, size_t> num_keypoints;
    for (const DatabaseImage& image : input.images) {
      if (input.cameras.count(image.camera_id) == 0) {
        return MakeError(ErrorCode::kCorrupt, "{}: image {} has camera {}, which the database does not list",
                         matches_path, image.name, image.camera_id);
      }
      CAIRN_ASSIGN_OR_RETURN(auto keypoints, ReadDatabaseKeypoints(database, image.image_id));
      num_keypoints[image.image_id] = keypoints.size();
      input.keypoints.push_back(std::move(keypoints));
    }
    CAIRN_ASSIGN_OR_RETURN(input.geometries, ReadDatabaseTwoViewGeometries(database, kMinNumMatches));
    for (const TwoViewGeometry& geometry : input.geometries) {
      const auto image1 = num_keypoints.find(geometry.image_id1),
                 image2 = num_keypoints.find(geometry.image_id2);
      const bool are_listed = image1 != num_keypoints.end() && image2 != num_keypoints.end();
      const bool is_valid =
          are_listed && std::all_of(geometry.inliers.begin(), geometry.inliers.end(), [&](const Match& m) {
            return m.idx1 < image1->second && m.idx2 < image2->second;
          });
      if (!is_valid) {
        return MakeError(ErrorCode::kCorrupt,
                         "{}: the pair of images {} and {} names an image or a keypoint that the database "
                         "lacks; match the features again",
                         matches_path, geometry.image_id1, geometry.image_id2);
      }
    }
    if (input.geometries.empty()) {
      return MakeError(ErrorCode::kNoData,
                       "{}: no pair of images has the {} verified matches that a reconstruction needs; do "
                       "the images show the same place?",
                       matches_path, kMinNumMatches);
    }
    return input;
  });
}

}  // namespace cairn::reconstruct
