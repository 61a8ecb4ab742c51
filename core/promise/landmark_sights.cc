#include "core/promise/landmark_sights.h"

#include <cmath>

#include "core/promise/pose_information.h"

namespace cairn {

LandmarkSights::LandmarkSights(const Classes& classes, const KeypointErrors& errors)
    : classes_(classes), errors_(errors) {
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
  std::unordered_map<ImageId, const SurveyImage*> images;
  for (const SurveyImage& image : classes.images) {
    images[image.image_id] = &image;
    const auto camera = cameras.find(image.camera_id);
    focal_of_image_[image.image_id] = camera == cameras.end() ? 1 : camera->second->MeanFocal();
  }
  size_rad_m_.reserve(classes.classes.size());
  for (const FeatureClass& feature_class : classes.classes) {
    double sum = 0;
    int num = 0;
    for (const Observation& observation : feature_class.observations) {
      const auto image = images.find(observation.image_id);
      if (image == images.end()) continue;
      const double distance = (image->second->cam_from_world * feature_class.position).norm();
      sum += observation.keypoint.scale * distance / focal_of_image_.at(observation.image_id);
      ++num;
    }
    size_rad_m_.push_back(num > 0 ? sum / num : 0);
  }
}

std::optional<Eigen::Matrix<double, 2, 6>> LandmarkSights::Root(size_t i, const Pose& cam_from_world,
                                                                double focal, double probability) const {
  const FeatureClass& feature_class = classes_.classes[i];
  const double distance = (cam_from_world * feature_class.position).norm();
  const double scale_px = distance > 0 ? size_rad_m_[i] * focal / distance : 0;
  const Eigen::Vector3d sigmas_px(errors_.sigma_px, errors_.sigma_per_scale * scale_px,
                                  feature_class.reprojection_error_px);
  const double sigma_px = sigmas_px.norm();
  return InformationRoot(feature_class, cam_from_world, sigma_px / focal, probability);
}

}  // namespace cairn
