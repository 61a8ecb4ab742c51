#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/random.h"
#include "core/camera/camera.h"
#include "core/world/feature_class.h"

namespace cairn::group_classes {

// Points of a scene, and images of several sessions that see some of them.
struct SceneOverTime {
  Classes classes;
  std::vector<int> session_of_image;

  void AddImage(int session, const Eigen::Vector3d& center, double turn_rad = 0) {
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()));
    SurveyImage image;
    image.image_id = static_cast<ImageId>(classes.images.size() + 1);
    image.name = "image" + std::to_string(image.image_id);
    image.camera_id = 1;
    image.cam_from_world = {rotation, -(rotation * center)};
    classes.images.push_back(image);
    session_of_image.push_back(session);
  }

  // Of a point in an image: the probability that it is seen there.
  using Visibility = std::function<double(int image, const Eigen::Vector3d& point)>;

  // Points that no image sees are left out; of the others true.
  bool AddPoint(const Eigen::Vector3d& point, const Visibility& visibility, Random* random) {
    FeatureClass feature;
    feature.class_id = static_cast<ClassId>(classes.classes.size() + 1);
    feature.position = point;
    for (size_t i = 0; i < classes.images.size(); ++i) {
      const SurveyImage& image = classes.images[i];
      const auto pixel = ImageFromCamera(classes.cameras.front(), image.cam_from_world * point);
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > 640 || pixel->y() > 480) continue;
      if (random->Uniform() >= visibility(static_cast<int>(i), point)) continue;
      Observation observation;
      observation.image_id = image.image_id;
      observation.keypoint = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y()), 2, 0};
      feature.observations.push_back(observation);
    }
    if (feature.observations.empty()) return false;
    classes.classes.push_back(feature);
    return true;
  }
};

inline SceneOverTime EmptyScene() {
  SceneOverTime scene;
  scene.classes.cameras.push_back({1, CameraModel::kPinhole, 640, 480, {500, 500, 320, 240}});
  return scene;
}

}  // namespace cairn::group_classes
