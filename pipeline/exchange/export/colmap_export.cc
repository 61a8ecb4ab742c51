#include "pipeline/exchange/export/colmap_export.h"

#include <unordered_map>

namespace cairn::pipeline {
namespace {

ModelPoint PointAt(uint64_t point_id, const Eigen::Vector3d& position, double error_px) {
  return {point_id, position, kExportColor, error_px, {}};
}

}  // namespace

ColmapModel ModelFromMap(const MapRows& rows) {
  ColmapModel model;
  for (const Camera& camera : rows.cameras) model.cameras.emplace(camera.camera_id, camera);
  for (size_t i = 0; i < rows.landmarks.size(); ++i)
    model.points.push_back(PointAt(i + 1, rows.landmarks[i].position, -1));
  for (const MapImage& image : rows.images) {
    ModelImage exported{image.image_id, image.name, image.camera_id, image.cam_from_world, {}};
    const Camera& camera = model.cameras.at(image.camera_id);
    for (const LandmarkIdx landmark : image.landmarks) {
      ModelPoint& point = model.points[landmark];
      const auto pixel = ImageFromCamera(camera, image.cam_from_world * point.position);
      if (!pixel) continue;
      point.track.emplace_back(image.image_id, static_cast<KeypointIdx>(exported.keypoints.size()));
      exported.keypoints.push_back({*pixel, point.point_id});
    }
    model.images.push_back(std::move(exported));
  }
  return model;
}

Result<ColmapModel> ModelFromClasses(const Classes& classes, const ImageKeypoints* keypoints) {
  ColmapModel model;
  for (const Camera& camera : classes.cameras) model.cameras.emplace(camera.camera_id, camera);
  std::unordered_map<ImageId, ModelImage*> image_of;
  model.images.reserve(classes.images.size());
  for (const SurveyImage& image : classes.images) {
    model.images.push_back({image.image_id, image.name, image.camera_id, image.cam_from_world});
    ModelImage& exported = model.images.back();
    image_of.emplace(image.image_id, &exported);
    if (keypoints == nullptr || !keypoints->contains(image.image_id)) continue;
    for (const Keypoint& keypoint : keypoints->at(image.image_id))
      exported.keypoints.push_back({{keypoint.x, keypoint.y}, kNoPoint});
  }
  for (const FeatureClass& feature : classes.classes) {
    ModelPoint point =
        PointAt(uint64_t{feature.class_id} + 1, feature.position, feature.reprojection_error_px);
    for (const Observation& observation : feature.observations) {
      const auto image = image_of.find(observation.image_id);
      if (image == image_of.end()) {
        return MakeError(ErrorCode::kCorrupt, "class {} is seen in image {}, which is not listed",
                         feature.class_id, observation.image_id);
      }
      std::vector<ModelKeypoint>& seen = image->second->keypoints;
      KeypointIdx keypoint_idx = observation.keypoint_idx;
      if (keypoints == nullptr) {
        keypoint_idx = static_cast<KeypointIdx>(seen.size());
        seen.push_back({{observation.keypoint.x, observation.keypoint.y}, kNoPoint});
      } else if (keypoint_idx >= seen.size()) {
        return MakeError(
            ErrorCode::kCorrupt,
            "class {} has keypoint {} of image {} ({}), which has {} keypoints; do the two files "
            "belong together?",
            feature.class_id, keypoint_idx, observation.image_id, image->second->name, seen.size());
      }
      seen[keypoint_idx].point_id = point.point_id;
      point.track.emplace_back(observation.image_id, keypoint_idx);
    }
    model.points.push_back(std::move(point));
  }
  return model;
}

}  // namespace cairn::pipeline
