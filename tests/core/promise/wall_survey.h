#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/pose.h"
#include "core/world/feature_class.h"

namespace cairn {

// A survey of a wall at z = `distance`, by cameras in a row at x = 0, spacing, 2 spacing, ... that look along
// z; focal length 200 px, 400 x 400 px.
inline Classes WallSurvey(int num_images, double spacing) {
  Classes classes;
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 400;
  camera.height = 400;
  camera.params = {200, 200, 200};
  classes.cameras = {camera};
  for (int i = 0; i < num_images; ++i) {
    SurveyImage image{.image_id = static_cast<ImageId>(i + 1), .name = std::to_string(i), .camera_id = 1};
    image.cam_from_world.translation = {-spacing * i, 0, 0};
    classes.images.push_back(image);
  }
  return classes;
}

// Adds a class at a place, seen by these images; its keypoints have this scale, px.
inline void AddClass(const Eigen::Vector3d& position, const std::vector<ImageId>& seen_by, float scale,
                     Classes* classes) {
  FeatureClass feature_class;
  feature_class.class_id = static_cast<ClassId>(10 + classes->classes.size());
  feature_class.position = position;
  feature_class.covariance = 1e-8 * Eigen::Matrix3d::Identity();
  for (const ImageId image : seen_by)
    feature_class.observations.push_back({image, 0, Keypoint{200, 200, scale, 0}});
  classes->classes.push_back(feature_class);
}

// Cameras in a row that look at a wall `depth` away: what is within a tenth of that is one view.
inline Classes Row(int num_images, double spacing, double depth) {
  Classes classes = WallSurvey(num_images, spacing);
  AddClass({0, 0, depth}, {1}, 3, &classes);
  return classes;
}

// Classes all along the wall, each seen by about a part `ratio` of the images that look at it; those with an
// odd number by the lesser part `odd_ratio`.
inline Classes RandomWallSurvey(int num_images, double spacing, int num_classes, double ratio,
                                double odd_ratio, uint64_t seed) {
  Classes classes = WallSurvey(num_images, spacing);
  Random random(seed);
  for (int i = 0; i < num_classes; ++i) {
    const double x = spacing * num_images * random.Uniform();
    std::vector<ImageId> seen_by;
    for (int image = 0; image < num_images; ++image) {
      if (std::abs(x - spacing * image) < 2 && random.Uniform() < (i % 2 == 1 ? odd_ratio : ratio))
        seen_by.push_back(static_cast<ImageId>(image + 1));
    }
    if (seen_by.size() >= 2) AddClass({x, 2 * random.Uniform() - 1, 2}, seen_by, 3, &classes);
  }
  return classes;
}

}  // namespace cairn
